#include "recordings/analysis/difference.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace ferrobench::recordings {
namespace {

using nlohmann::json;

// Over pairs that are both known.
class Differences {
 public:
  void add(double a, double b) {
    if (std::isnan(a) || std::isnan(b)) return;
    ++known_;
    if (a == b) return;
    squares_ += (b - a) * (b - a);
    sum_ += b - a;
    maximum_ = std::max(maximum_, std::abs(b - a));
  }
  void give(ColumnDifference& out) const {
    const double known = std::max(known_, 1.0);
    out.rms = std::sqrt(squares_ / known);
    out.mean = sum_ / known;
    out.maximum = maximum_;
  }

 private:
  double known_ = 0, squares_ = 0, sum_ = 0, maximum_ = 0;
};

// Where the column differs. `at_a` and `at_b` give the value of a row.
template <class A, class B>
void look(ColumnDifference& out, A&& at_a, B&& at_b) {
  const auto both = std::min(out.rows_a, out.rows_b);
  Differences found;
  const auto note = [&out](std::uint64_t row, std::optional<double> a, std::optional<double> b) {
    ++out.unequal;
    if (!out.first) out.first = {row, a, b};
  };
  for (std::uint64_t i = 0; i < both; ++i) {
    const double a = at_a(i), b = at_b(i);
    const bool same = std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
    if (!same && !(std::isnan(a) && std::isnan(b))) note(i, a, b);
    found.add(a, b);
  }
  for (auto i = both; i < std::max(out.rows_a, out.rows_b); ++i)
    note(i, i < out.rows_a ? std::optional(at_a(i)) : std::nullopt,
         i < out.rows_b ? std::optional(at_b(i)) : std::nullopt);
  found.give(out);
}

// The value of a channel at t; NaN beyond its ends and in a gap.
double interpolated(const std::vector<double>& time, const std::vector<double>& values, double t) {
  if (time.empty() || !(t >= time.front() && t <= time.back())) return NAN;
  const auto after = static_cast<std::size_t>(std::ranges::lower_bound(time, t) - time.begin());
  if (after == time.size()) return NAN;  // times of a foreign file need not rise
  if (after == 0 || time[after] == t) return values[after];
  const auto before = after - 1;
  return std::lerp(values[before], values[after], (t - time[before]) / (time[after] - time[before]));
}

bool same_times(const std::vector<double>& a, const std::vector<double>& b) {
  for (std::size_t i = 1; i < std::min(a.size(), b.size()); ++i)
    if (std::abs(a[i] - b[i]) > 0.5 * std::min(a[i] - a[i - 1], b[i] - b[i - 1])) return false;
  return true;
}

// In place of figures that were taken row by row.
void look_by_time(Difference& out, const Recording& a, const Recording& b) {
  out.by_time = true;
  const auto& times = a.size() <= b.size() ? a.time : b.time;
  const auto both_have = [&](double t) {
    return t >= std::max(a.time.front(), b.time.front()) && t <= std::min(a.time.back(), b.time.back());
  };
  out.common = static_cast<std::uint64_t>(std::ranges::count_if(times, both_have));
  for (auto& c : out.columns) {
    if (!c.in_a || !c.in_b) continue;
    const auto channel =
        std::ranges::find_if(all_channels, [&](Channel each) { return c.dataset == channel_place(each); });
    if (channel == all_channels.end()) {
      c.rms = c.mean = c.maximum = NAN;
      continue;
    }
    Differences found;
    for (const double t : times)
      found.add(interpolated(a.time, a.at(*channel), t), interpolated(b.time, b.at(*channel), t));
    found.give(c);
  }
}

ColumnDifference column(const std::string& dataset, const std::string& unit, const std::vector<double>* a,
                        const std::vector<double>* b) {
  ColumnDifference out{.dataset = dataset, .unit = unit, .in_a = a != nullptr, .in_b = b != nullptr};
  if (a != nullptr) out.rows_a = a->size();
  if (b != nullptr) out.rows_b = b->size();
  if (out.in_a && out.in_b)
    look(
        out, [a](std::uint64_t i) { return (*a)[i]; }, [b](std::uint64_t i) { return (*b)[i]; });
  return out;
}

// The counts of one channel: the first raw column of that name.
struct Counts {
  const std::int16_t* first = nullptr;
  std::size_t width = 1;
  std::uint64_t rows = 0;

  Counts(const Recording& r, Channel channel) {
    if (!r.raw) return;
    const auto& columns = r.raw->columns;
    const auto found = std::ranges::find(columns, channel, &RawColumn::channel);
    if (found == columns.end()) return;
    first = r.raw->counts.data() + (found - columns.begin());
    width = columns.size();
    rows = r.raw->counts.size() / width;
  }
  double at(std::uint64_t row) const { return first[row * width]; }
};

std::vector<ColumnDifference> columns_of(const Recording& a, const Recording& b) {
  std::vector<ColumnDifference> out{column("/entry/data/time", "s", &a.time, &b.time)};
  for (const auto channel : all_channels)
    if (a.has(channel) || b.has(channel))
      out.push_back(column(channel_place(channel), std::string(channel_unit(channel)),
                           a.has(channel) ? &a.at(channel) : nullptr,
                           b.has(channel) ? &b.at(channel) : nullptr));
  for (const auto channel : all_channels) {
    const Counts in_a(a, channel), in_b(b, channel);
    if (in_a.first == nullptr && in_b.first == nullptr) continue;
    ColumnDifference raw{.dataset = "/entry/instrument/raw/ai (" + std::string(channel_name(channel)) + ")",
                         .unit = "counts",
                         .in_a = in_a.first != nullptr,
                         .in_b = in_b.first != nullptr,
                         .rows_a = in_a.rows,
                         .rows_b = in_b.rows};
    if (raw.in_a && raw.in_b)
      look(
          raw, [&](std::uint64_t i) { return in_a.at(i); }, [&](std::uint64_t i) { return in_b.at(i); });
    out.push_back(std::move(raw));
  }
  return out;
}

json tables_of(const Recording& r) {
  json out{
      {"status", r.status}, {"reason", r.reason}, {"segments", json::array()}, {"events", json::array()}};
  for (const auto channel : all_channels)
    if (const auto& noise = r.noise[static_cast<std::size_t>(channel)])
      out["noise"][std::string(channel_name(channel))] = *noise;
  for (const auto& s : r.segments)
    out["segments"].push_back({{"start_sample", s.start_sample},
                               {"end_sample", s.end_sample},
                               {"kind", s.kind},
                               {"label", s.label},
                               {"level", s.level},
                               {"rate", s.rate}});
  for (const auto& e : r.events)
    out["events"].push_back({{"time", e.time}, {"kind", e.kind}, {"message", e.message}});
  if (r.raw)
    for (const auto& c : r.raw->columns)
      out["scaling"].push_back(
          {{"channel", channel_name(c.channel)}, {"gain", c.gain}, {"offset", c.offset}});
  return out;
}

json header_of(const Recording& r) {
  const auto& h = r.header;
  return {
      {"title", h.title},
      {"start_time", h.start_time},
      {"end_time", r.end_time},
      {"entry_identifier", h.entry_identifier},
      {"run_seed", h.run_seed ? json(*h.run_seed) : json()},
      {"protocol", h.protocol},
      {"model", h.model},
      {"device", h.device},
      {"sample", to_json(h.specimen)},
      {"load", to_json(h.load)},
      {"charge_reference", h.charge_reference == ChargeReference::absolute ? "absolute" : "first_sample"}};
}

// An event a rounding error away from where it was has not moved.
bool alike(const json& a, const json& b, std::string_view place) {
  if (a == b) return true;
  if (!place.starts_with("/events") || !a.is_number() || !b.is_number()) return false;
  const double x = a.get<double>(), y = b.get<double>();
  return std::abs(x - y) <= 1e-9 * std::max(1.0, std::abs(x));
}

void differ(const json& a, const json& b, const std::string& place, std::vector<ValueDifference>& out) {
  if (alike(a, b, place)) return;
  const auto missing = [](const json& in, const auto& key) {
    return in.is_object() ? !in.contains(key) : true;
  };
  const auto inside = [&](const std::string& key) { return std::string(place).append("/").append(key); };
  if (a.is_object() && b.is_object()) {
    for (const auto& [key, value] : a.items())
      differ(value, missing(b, key) ? json() : b[key], inside(key), out);
    for (const auto& [key, value] : b.items())
      if (missing(a, key)) differ(json(), value, inside(key), out);
  } else if (a.is_array() && b.is_array()) {
    for (std::size_t i = 0; i < std::max(a.size(), b.size()); ++i)
      differ(i < a.size() ? a[i] : json(), i < b.size() ? b[i] : json(), inside(std::to_string(i)), out);
  } else {
    out.push_back({place, a, b});
  }
}

json value(const std::optional<double>& v) {
  return v && std::isfinite(*v) ? json(*v) : json();
}

}  // namespace

const ColumnDifference* Difference::first_column() const {
  const auto found = std::ranges::find_if(columns, [](const auto& c) { return !c.identical(); });
  return found == columns.end() ? nullptr : &*found;
}

bool Difference::same_samples() const {
  return first_column() == nullptr;
}

Difference compare(const Recording& a, const Recording& b) {
  Difference out{.columns = columns_of(a, b), .tables = {}, .header = {}};
  if (!same_times(a.time, b.time)) look_by_time(out, a, b);
  differ(tables_of(a), tables_of(b), "", out.tables);
  differ(header_of(a), header_of(b), "", out.header);
  return out;
}

std::string by_time_in_words(const Difference& d) {
  if (!d.by_time) return "";
  const auto& time = d.columns.front();
  return "The recordings have " + std::to_string(time.rows_a) + " and " + std::to_string(time.rows_b) +
         " rows at other times and cannot be compared row by row: rms and maximum are at the " +
         std::to_string(d.common) +
         " times of the one with fewer rows at which there is a value of the other, interpolated between "
         "rows.";
}

json to_json(const Difference& d) {
  json out{{"same_samples", d.same_samples()}, {"by_time", d.by_time},    {"note", by_time_in_words(d)},
           {"columns", json::array()},         {"tables", json::array()}, {"header", json::array()}};
  for (const auto& c : d.columns) {
    json row{{"dataset", c.dataset},
             {"unit", c.unit},
             {"in_a", c.in_a},
             {"in_b", c.in_b},
             {"rows_a", c.rows_a},
             {"rows_b", c.rows_b},
             {"rms", value(c.rms)},
             {"mean", value(c.mean)},
             {"maximum", value(c.maximum)},
             {"unequal", c.unequal},
             {"identical", c.identical()}};
    if (c.first) row["first"] = {{"row", c.first->row}, {"a", value(c.first->a)}, {"b", value(c.first->b)}};
    out["columns"].push_back(std::move(row));
  }
  for (const auto& [name, list] : {std::pair{"tables", &d.tables}, std::pair{"header", &d.header}})
    for (const auto& v : *list) out[name].push_back({{"place", v.place}, {"a", v.a}, {"b", v.b}});
  return out;
}

}  // namespace ferrobench::recordings
