#include "daq/replay/play.h"

#include "daq/scaling.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::daq {

namespace {

template <class T>
void append(std::vector<T>& to, std::span<const T> from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

Replay play(ReplayDevice& device, const Limits& bench, const std::function<bool(double)>& go_on) {
  const auto& source = device.source();
  Guard guard(device, source.limits(bench));
  Scaling scaling(device.columns(), source.signals(), source.rate());
  Replay out;
  auto& r = out.recording;
  r.header = source.header();
  r.header.device = device.info();
  r.header.start_time = recordings::iso_now();
  r.noise = device.noise();
  r.time.reserve(source.size());
  for (const auto channel : scaling.channels()) r.set(channel).reserve(source.size());
  if (!scaling.columns().empty()) {
    auto& raw = r.raw.emplace();
    raw.columns = {scaling.columns().begin(), scaling.columns().end()};
    raw.counts.reserve(source.size() * raw.columns.size());
  }

  auto program = source.program();
  guard.go_to(program.value(0), guard.limits().stop_slew);
  guard.start(std::move(program));
  for (SampleBlock block; guard.read(block);) {
    if (block.rows > 0) {
      const auto rows = scaling.rows(block);
      append(r.time, rows.time);
      for (const auto channel : scaling.channels()) {
        const auto c = static_cast<std::size_t>(channel);
        append(*r.channels[c], rows.channels[c]);
      }
      if (r.raw) append(r.raw->counts, rows.counts);
    }
    r.events.insert(r.events.end(), block.events.begin(), block.events.end());
    if (go_on && !go_on(static_cast<double>(r.size()) / static_cast<double>(source.size())))
      guard.stop("stopped by the operator");
  }
  out.outcome = guard.outcome();
  auto closing =
      source.closing(out.outcome.end, out.outcome.reason, guard.segments(), guard.progress().rows_read);
  r.status = std::move(closing.status);
  r.reason = std::move(closing.reason);
  r.segments = std::move(closing.segments);
  if (!r.time.empty())
    r.end_time = recordings::iso_after(r.header.start_time, r.time.back()).value_or(r.header.start_time);
  return out;
}

}  // namespace ferrobench::daq
