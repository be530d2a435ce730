#include "model/inference/dataset/succession.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

namespace ferrobench::model {
namespace {

using protocols::Past;
using protocols::PastKind;
using protocols::VisitedLevel;

// Within this share of the largest field a tester's reading turns around by its noise, and programs go as far
// as each other.
constexpr double same_level = 0.02;
// A program wipes out one that reaches less far on both sides by this share of its span, or the last of which
// so many go as far, if it is no more than so many times as fast. On the loops of a real ceramic that leaves
// what comes next as the whole past does, within 0.3 % of the charge's range and 0.4 % of the displacement's;
// half of the margin is 0.7 and 6 % off, half as many programs are 1.3 and 5 %.
constexpr double margin = 0.12;
constexpr int as_many = 8;
constexpr double as_fast = 3;

// The table's number in the file that an importer read; none for what was recorded otherwise.
std::optional<std::int64_t> table_of(const recordings::Header& header) {
  const auto& device = header.device;
  if (!device.is_object() || device.value("driver", nlohmann::json()) != "import") return std::nullopt;
  const auto table = device.find("table");
  if (table == device.end() || !table->is_number_integer()) return std::nullopt;
  return table->get<std::int64_t>();
}

// Of what was imported.
bool same_file_and_specimen(const recordings::Header& a, const recordings::Header& b) {
  const auto same = [&](const char* key) {
    return a.device.value(key, nlohmann::json()) == b.device.value(key, nlohmann::json());
  };
  return same("source") && same("file_header") && a.specimen.area == b.specimen.area &&
         a.specimen.layer_thickness == b.specimen.layer_thickness;
}

// One way through a recording's program.
class Pass {
 public:
  explicit Pass(const RecordingData& recording) {
    drive_ = simplify(recording.drive, same_level * largest_field(recording.drive.field));
    std::tie(low_, high_) = std::pair(std::ranges::min(drive_.field), std::ranges::max(drive_.field));
    pace_ = mean_pace(drive_.time, drive_.field);
  }
  bool moves() const { return pace_ > 0; }

  // By a share of the span of `other`, on both sides; negative: almost as far.
  bool goes_beyond(const Pass& other, double share) const {
    const double more = share * (other.high_ - other.low_);
    return low_ <= other.low_ - more && high_ >= other.high_ + more && pace_ <= as_fast * other.pace_;
  }

  // To its beginning at its own pace, and through it.
  void append_to(std::vector<VisitedLevel>& levels) const {
    const double from = levels.empty() ? 0 : levels.back().field, to = drive_.field.front();
    if (to != from) levels.push_back({to, std::abs(to - from) / pace_});
    for (std::size_t k = 1; k < drive_.field.size(); ++k)
      levels.push_back({drive_.field[k], drive_.time[k] - drive_.time[k - 1]});
  }

 private:
  Drive drive_;
  double low_ = 0, high_ = 0, pace_ = 0;  // V/m, V/m, V/m/s
};

struct Table {
  const Past& said;  // by its recording
  Pass own;
};

bool is_wiped_out(const Pass& pass, std::span<const Pass> later) {
  return std::ranges::any_of(later, [&](const Pass& l) { return l.goes_beyond(pass, margin); }) ||
         std::ranges::count_if(later, [&](const Pass& l) { return l.goes_beyond(pass, -same_level); }) >=
             as_many;
}

std::vector<VisitedLevel> way_through(std::span<const Pass> passes) {
  std::vector<VisitedLevel> out;
  for (std::size_t i = 0; i < passes.size(); ++i)
    if (!is_wiped_out(passes[i], passes.subspan(i + 1))) passes[i].append_to(out);
  return out;
}

// The pasts of all tables, if each was cycled before, or if none was. One whose recording says it is where
// those of the tables after it begin.
std::vector<Past> pasts_of(std::span<const Table> tables, bool cycled, PastKind state) {
  std::vector<Past> out;
  Past before{state};
  std::vector<Pass> passes;
  for (const auto& [said, own] : tables) {
    if (said.known()) {
      before = said;
      passes.clear();
    } else if (cycled && own.moves()) {
      passes.push_back(own);
    }
    out.push_back(protocols::and_then(before, way_through(passes)));
    if (own.moves()) passes.push_back(own);
  }
  return out;
}

}  // namespace

std::vector<Succession> successions(std::span<const RecordingData> recordings) {
  std::vector<std::pair<std::int64_t, std::size_t>> tables;
  for (std::size_t i = 0; i < recordings.size(); ++i)
    if (const auto table = table_of(recordings[i].header)) tables.emplace_back(*table, i);
  std::ranges::sort(tables);

  std::vector<Succession> out;
  for (const auto& [table, i] : tables) {
    const auto& header = recordings[i].header;
    auto of_this = std::ranges::find_if(out, [&](const Succession& s) {
      return same_file_and_specimen(recordings[s.recordings.front()].header, header);
    });
    if (of_this == out.end()) of_this = out.emplace(out.end());
    of_this->recordings.push_back(i);
  }
  std::erase_if(out, [](const Succession& s) { return s.recordings.size() == 1; });
  for (auto& s : out) {
    std::vector<Table> of_file;
    of_file.reserve(s.recordings.size());
    for (const auto i : s.recordings) of_file.push_back({recordings[i].header.past, Pass(recordings[i])});
    for (const bool cycled : {true, false})
      for (const auto state : {PastKind::unpoled, PastKind::poled_minus, PastKind::poled_plus})
        s.hypotheses.push_back(pasts_of(of_file, cycled, state));
  }
  return out;
}

}  // namespace ferrobench::model
