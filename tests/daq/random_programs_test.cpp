// 10^5 programs nobody would write, each ended in one of the ways that a run can end: no sample passes a
// limit, and the output is at zero afterwards.
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include "daq/guard/guard.h"
#include "faulty_device.h"
#include "programs.h"

namespace ferrobench::daq {
namespace {

using protocols::Piece;

// Choices as small numbers, so that generating and shrinking are quick.
using Choices = std::vector<std::uint16_t>;

class Maker {
 public:
  explicit Maker(const Choices& choices) : choices_(choices) {}

  int below(int count) {
    if (at_ >= choices_.size()) return 0;
    return choices_[at_++] % count;
  }
  double share() { return below(1001) / 1000.0; }  // 0 .. 1
  double sign() { return below(2) == 0 ? 1 : -1; }

  Limits limits() {
    Limits l;
    if (below(2) == 0) return l;
    l.field_max = below(4) == 0 ? 0 : std::pow(10, 3 + 5 * share());
    l.field_min = -std::pow(10, 3 + 5 * share());
    const double range = l.field_max - l.field_min;
    l.slew = range * std::pow(10, -0.9 + 4.9 * share());
    l.stop_slew = std::max(l.slew * std::pow(10, -3 * share()), range / l.stop_time);
    l.reverse_field_threshold = l.field_min * share();
    l.reverse_field_time = std::pow(10, -3 + 6 * share());
    return l;
  }

  double level(const Limits& l) {
    switch (below(8)) {
      case 0:
        return 0;
      case 1:
        return l.field_max;
      case 2:
        return l.field_min;
      case 3:
        return l.field_max * (1 + 1e-6 * share());
      case 4:
        return sign() * 1e300;
      case 5:
        return sign() * std::pow(10, 12 * share());
      default:
        return l.field_min + (l.field_max - l.field_min) * share();
    }
  }

  double duration() { return std::pow(10, below(4) == 0 ? -12 * share() : -2 + 4 * share()); }

  // Within the limits, most of the time.
  protocols::SampledWaveform sane(const Limits& l) {
    std::vector<Piece> pieces;
    double here = 0;
    const int count = 1 + below(5);
    for (int i = 0; i < count; ++i) {
      const int kind = below(4);
      const double there = kind == 0 ? here : 0.999 * (l.field_min + (l.field_max - l.field_min) * share());
      const double steepness = l.slew * std::pow(10, -2 * share());
      if (kind == 1) {
        const double size = std::min(l.field_max - here, here - l.field_min) * share();
        pieces.push_back(sine(here, size, size > 0 ? steepness / size / 7 : 1, 0));
        pieces.back().duration = share() * 3 / pieces.back().frequency + 1e-9;
        pieces.back() = sine(here, size, pieces.back().frequency, pieces.back().duration);
        here = pieces.back().to;
      } else {
        pieces.push_back(line(here, there, std::max(std::abs(there - here) / steepness, 1e-6)));
        here = there;
      }
    }
    return sampled(std::move(pieces), l);
  }

  protocols::SampledWaveform mad(const Limits& l) {
    std::vector<Piece> pieces;
    double here = below(3) == 0 ? level(l) : 0;
    const int count = 1 + below(6);
    for (int i = 0; i < count; ++i) {
      if (below(6) == 0) here = level(l);  // a jump
      const double there = level(l);
      if (below(4) == 0) {
        pieces.push_back(sine(here, there, std::pow(10, -3 + 9 * share()), duration(), 7 * share()));
        here = pieces.back().to;
      } else {
        pieces.push_back(line(here, there, duration()));
        here = there;
      }
    }
    return sampled(std::move(pieces), l);
  }

 private:
  // At a rate that makes some hundred samples, and no more than some thousand of the longest way to zero.
  protocols::SampledWaveform sampled(std::vector<Piece> pieces, const Limits& l) {
    double duration = 0;
    for (const auto& p : pieces) duration += p.duration;
    const double most = 2000 * l.stop_slew / (l.field_max - l.field_min);
    return program(std::move(pieces), std::min(std::pow(10, 2.5 * share()) / duration, most));
  }

  const Choices& choices_;
  std::size_t at_ = 0;
};

void demand(bool fine, const char* what) {
  if (!fine) throw std::runtime_error(what);
}

struct ReaderFailed {};

// What the engine does, with an accident in the middle.
void run_with_accident(Maker& make, FaultyDevice& device, const Limits& limits,
                       const protocols::SampledWaveform& program) {
  int reads = 0;
  const int accident = make.below(12);
  const int when = make.below(8);
  bool closed = true;
  device.block_rows = static_cast<std::size_t>(1 + make.below(100));
  device.fault = static_cast<Fault>(make.below(3) == 0 ? make.below(fault_count) : 0);
  device.fault_at = make.below(6);

  Guard guard(device, limits, [&closed] { return closed; });
  guard.go_to(program.value(0), limits.slew * (0.01 + make.share()));
  guard.start(program);
  device.deaf = make.below(8) == 0 ? 2 : 0;
  SampleBlock block;
  for (; guard.read(block); ++reads) {
    demand(block.command.size() == block.rows, "a command for each row");
    // Blocks may be of a single row, and a stop at the slowest slew takes some thousand of them.
    demand(reads < 20000, "the run ends");
    // After a pause of a few reads at least, wherever the next hold was.
    if (reads % 16 == 15 && guard.progress().state == Progress::State::paused) guard.resume();
    if (reads != when) continue;
    if (accident == 0) guard.stop("aborted");
    if (accident == 1) closed = false;
    if (accident == 2) device.displacement = 20000;
    if (accident == 3) throw ReaderFailed{};
    if (accident == 4) return;
    if (accident == 5) {
      try {
        guard.pause();
      } catch (const Error&) {
      }
    }
    if (accident == 6) closed = false, guard.stop("both"), device.fault = Fault::throws;
  }
  const auto outcome = guard.outcome();
  demand(outcome.end != End::none, "the run has an outcome");
  demand(outcome.output_at_zero, "the outcome knows of the zero");
  demand(device.output() == 0, "the output is at zero before the guard is gone");
}

// True if the program was allowed to run.
bool whatever_happens(const Choices& choices) {
  Maker make(choices);
  const Limits limits = make.limits();
  FaultyDevice device(limits);
  // The monitor reads the whole range; a field outside it would be a trip of its own.
  device.monitor_gain = (limits.field_max - limits.field_min) / 30000;
  const bool sane = make.below(3) != 0;
  const auto program = sane ? make.sane(limits) : make.mad(limits);
  bool ran = false;
  try {
    run_with_accident(make, device, limits, program);
    ran = true;
  } catch (const Error&) {  // refused
  } catch (const ReaderFailed&) {
    ran = true;
  }
  demand(device.output() == 0, "the output is at zero");
  demand(device.steepest_go_to <= limits.slew * (1 + 1e-12), "no go_to is too steep");
  demand(device.watched.crime().empty(), device.watched.crime().c_str());
  return ran;
}

// The last line on its own: the program goes out without having been checked.
void even_unchecked(const Choices& choices) {
  Maker make(choices);
  const Limits limits = make.limits();
  WatchedOutput watched(limits);
  const auto program = make.mad(limits);
  const double first = program.value(0);
  if (!(first >= limits.field_min && first <= limits.field_max)) return;
  Feed feed(program, limits);
  double here = first;
  watched.put(here, std::numeric_limits<double>::infinity());
  for (LinearPiece piece; (piece = feed.next(static_cast<std::uint64_t>(1 + make.below(50)))).samples != 0;) {
    for (std::uint64_t i = 1; i < piece.samples; ++i)
      watched.put(here + (piece.level - here) * static_cast<double>(i) / static_cast<double>(piece.samples),
                  1 / program.rate());
    watched.put(here = piece.level, 1 / program.rate());
    if (watched.samples() > 20000) feed.stop(End::stopped, "long enough");
    demand(watched.samples() < 5000000, "a stop ends");
  }
  demand(watched.crime().empty(), watched.crime().c_str());
}

template <class Property>
bool check_many(const char* name, int count, Property property) {
  const auto choices = rc::gen::container<Choices>(60, rc::gen::arbitrary<std::uint16_t>());
  rc::detail::TestMetadata metadata;
  metadata.id = metadata.description = name;
  auto params = rc::detail::configuration().testParams;
  params.maxSuccess = count;
  const auto result = rc::detail::checkTestable([&] { property(*choices); }, metadata, params);
  rc::detail::printResultMessage(result, std::cerr);
  return result.template is<rc::detail::SuccessResult>();
}

TEST(RandomPrograms, NeverPassALimitAndAlwaysEndAtZero) {
  int ran = 0;
  EXPECT_TRUE(
      check_many("guarded", 100'000, [&ran](const Choices& c) { ran += whatever_happens(c) ? 1 : 0; }));
  EXPECT_GT(ran, 30'000) << "too few programs were let through to mean anything";
}

TEST(RandomPrograms, AreHeldBackEvenIfNobodyCheckedThem) {
  EXPECT_TRUE(check_many("unchecked", 100'000, even_unchecked));
}

}  // namespace
}  // namespace ferrobench::daq
