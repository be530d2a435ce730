#include "model/inference/dataset/succession.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace ferrobench::model {
namespace {

using protocols::Past;
using protocols::PastKind;
using protocols::VisitedLevel;

// Extreme levels within this of each other, as a share of the loop, are the same: a repeated loop never
// reaches quite as far as the one before.
constexpr double same_level = 0.02;
// A loop wipes out what one within it left if it was no more than so many times as fast: the field at which a
// domain switches goes with the logarithm of the rate, and 3 moves it by a few percent.
constexpr double as_slow = 3;

// The place in a file that an importer read; none for what was recorded otherwise.
struct Place {
  const recordings::Header& header;
  std::int64_t table;

  bool comes_before(const Place& other) const {
    const auto same = [&](const char* key) {
      return header.device.value(key, nlohmann::json()) == other.header.device.value(key, nlohmann::json());
    };
    const auto &own = header.specimen, &others = other.header.specimen;
    return same("source") && same("file_header") && own.area == others.area &&
           own.layer_thickness == others.layer_thickness && table < other.table;
  }
};

std::optional<Place> place_of(const recordings::Header& header) {
  const auto& device = header.device;
  if (!device.is_object() || device.value("driver", nlohmann::json()) != "import") return std::nullopt;
  const auto table = device.find("table");
  if (table == device.end() || !table->is_number_integer()) return std::nullopt;
  return Place{header, table->get<std::int64_t>()};
}

// Extreme levels of a field, without those that later ones wiped out.
class Extremes {
 public:
  void add(const Drive& drive) {
    double path = 0;
    for (std::size_t k = 1; k < drive.field.size(); ++k)
      path += std::abs(drive.field[k] - drive.field[k - 1]);
    if (!(path > 0)) return;
    const double pace = path / (drive.time.back() - drive.time.front());
    go_to({drive.field.front(), std::abs(drive.field.front() - levels_.back().field) / pace});
    for (std::size_t k = 1; k < drive.field.size(); ++k)
      go_to({drive.field[k], drive.time[k] - drive.time[k - 1]});
  }
  // Without the specimen at rest, which is where it begins.
  std::vector<VisitedLevel> levels() const { return {levels_.begin() + 1, levels_.end()}; }

 private:
  static double reach(const VisitedLevel& from, const VisitedLevel& to) {
    return std::abs(to.field - from.field);
  }
  static double rate(const VisitedLevel& from, const VisitedLevel& to) {
    return reach(from, to) / to.seconds;
  }

  // A hold counts to the way that led to it.
  void go_to(const VisitedLevel& next) {
    const auto n = levels_.size();
    const double way = next.field - levels_.back().field;
    if (n > 1 && way * (levels_.back().field - levels_[n - 2].field) >= 0) {
      levels_.back().field = next.field;
      levels_.back().seconds += next.seconds;
    } else if (way != 0) {
      levels_.push_back(next);
    }
    while (wipe_out()) {
    }
  }

  // The loop between the last four levels, if the ways to it and from it enclose it.
  bool wipe_out() {
    if (levels_.size() < 4) return false;
    const auto* const last = &levels_.back();
    const auto &a = last[-3], &b = last[-2], &c = last[-1], &d = last[0];
    const double loop = reach(b, c) * (1 - same_level), slowest = as_slow * rate(b, c);
    if (reach(a, b) < loop || reach(c, d) < loop || rate(a, b) > slowest || rate(c, d) > slowest)
      return false;
    const double at_pace = reach(a, d) / rate(c, d);
    levels_.back().seconds = at_pace;
    levels_.erase(levels_.end() - 3, levels_.end() - 1);
    return true;
  }

  std::vector<VisitedLevel> levels_{{0, 0}};
};

// The tables before a recording's own, in their order.
std::vector<const RecordingData*> before(const Place& own, std::span<const RecordingData> recordings) {
  std::vector<std::pair<std::int64_t, const RecordingData*>> found;
  for (const auto& r : recordings)
    if (const auto place = place_of(r.header); place && place->comes_before(own))
      found.emplace_back(place->table, &r);
  std::ranges::stable_sort(found, {}, [](const auto& f) { return f.first; });
  std::vector<const RecordingData*> out;
  out.reserve(found.size());
  for (const auto& [table, recording] : found) out.push_back(recording);
  return out;
}

}  // namespace

std::vector<std::vector<Past>> pasts_by_succession(std::span<const RecordingData> recordings) {
  std::vector<std::vector<Past>> out(recordings.size());
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    const auto own = place_of(recordings[i].header);
    if (!own) continue;
    Extremes extremes;
    for (const auto* r : before(*own, recordings)) extremes.add(r->simplified);
    const auto left = extremes.levels();
    if (left.empty()) continue;
    auto cycled = left;
    const auto& program = recordings[i].simplified;
    for (std::size_t k = 1; k < program.field.size(); ++k)
      cycled.push_back({program.field[k], program.time[k] - program.time[k - 1]});
    for (const auto& levels : {cycled, left})
      for (const auto state : {PastKind::unpoled, PastKind::poled_minus, PastKind::poled_plus})
        if (auto past = protocols::and_then({state}, levels); past.known()) out[i].push_back(std::move(past));
  }
  return out;
}

}  // namespace ferrobench::model
