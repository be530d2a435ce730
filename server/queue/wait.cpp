#include "server/queue/wait.h"

#include <array>
#include <cmath>

#include "base/headings.h"
#include "base/number_text.h"
#include "base/shown_unit.h"

namespace ferrobench::server {

using nlohmann::json;

namespace {

constexpr double stretch = 0.1;      // s
constexpr double sample_rate = 100;  // Hz: hum of 50 and 60 Hz still averages out over a stretch
// A clock as fast as possible has played the hold before anybody can stop it; a real one never gets there.
constexpr double spare = 1;  // s

struct Known {
  recordings::Channel channel;
  Quantity quantity;
};
Known known(Watched channel) {
  using recordings::Channel;
  constexpr std::array<Known, 4> all{{{Channel::field, Quantity::field},
                                      {Channel::charge, Quantity::charge},
                                      {Channel::displacement, Quantity::displacement},
                                      {Channel::force, Quantity::force}}};
  return all.at(static_cast<std::size_t>(channel));
}

std::string name_of(const Wait& wait) {
  return std::string(recordings::channel_name(known(wait.channel).channel));
}

std::string unit_of(const Wait& wait) {
  return wait.unit.empty() ? std::string(recordings::channel_unit(known(wait.channel).channel)) : wait.unit;
}

const KnownUnit* find(const Wait& wait) {
  return find_unit(unit_of(wait), std::array{known(wait.channel).quantity});
}

std::string with_unit(double value, const Wait& wait) {
  return number_text(value) + " " + shown_unit(unit_of(wait));
}

}  // namespace

std::span<const std::pair<Watched, std::string_view>> enum_names(Watched) {
  static constexpr std::array<std::pair<Watched, std::string_view>, 4> names{
      {{Watched::field, "field"},
       {Watched::charge, "charge"},
       {Watched::displacement, "displacement"},
       {Watched::force, "force"}}};
  return names;
}

void check_wait(const Wait& wait, const std::string& path, std::vector<Problem>& problems) {
  if (find(wait) == nullptr)
    problems.push_back({.path = path + "/unit",
                        .message = "is no unit of " + name_of(wait),
                        .given = excerpt(wait.unit),
                        .allowed = units_of(std::array{known(wait.channel).quantity})});
  if (wait.lasting > wait.timeout)
    problems.push_back({.path = path + "/timeout_s",
                        .message = "is over before the condition can have held",
                        .given = wait.timeout,
                        .allowed = {{"from", wait.lasting}},
                        .unit = "s",
                        .hint = "wait longer, or lower for_s"});
}

std::string text_of(const Wait& wait) {
  return name_of(wait) + " within " + with_unit(wait.tolerance, wait) + " of " + with_unit(wait.value, wait) +
         " for " + number_text(wait.lasting) + " s";
}

json hold_of(const Wait& wait, json protocol) {
  protocol["name"] = "wait";
  protocol["title"] = "Waits at zero field: " + text_of(wait);
  protocol["sample_rate_Hz"] = sample_rate;
  protocol["start"] = 0;
  protocol["segments"] = {{{"kind", "hold"}, {"time", wait.timeout + spare}}};
  for (const char* others : {"source", "notes", "unattended"}) protocol.erase(others);
  return protocol;
}

Watch::Watch(const Wait& wait) : wait_(wait), si_(find(wait)->si) {}

void Watch::see(const recordings::Rows& rows) {
  const std::scoped_lock lock(mutex_);
  const auto values = rows.channels.at(static_cast<std::size_t>(known(wait_.channel).channel));
  if (values.empty() && !rows.time.empty())
    decide(Verdict::failed, "waits for the " + name_of(wait_) + ", which the device does not measure");
  for (std::size_t i = 0; i < values.size() && verdict_ == Verdict::none; ++i) {
    const auto at = static_cast<std::int64_t>(std::floor(rows.time[i] / stretch + 1e-6));
    if (at != stretch_) {
      take_mean();
      if (at != stretch_ + 1) within_.reset();  // rows were lost
      stretch_ = at;
      sum_ = 0;
      count_ = 0;
    }
    if (!std::isfinite(values[i])) continue;
    sum_ += values[i];
    ++count_;
  }
}

void Watch::take_mean() {
  const double end = static_cast<double>(stretch_ + 1) * stretch;
  if (count_ > 0) last_ = sum_ / static_cast<double>(count_) / si_;
  if (count_ == 0 || std::abs(*last_ - wait_.value) > wait_.tolerance)
    within_.reset();
  else if (!within_)
    within_ = stretch_;
  constexpr double rounding = 1e-9;  // s
  if (within_ && end - static_cast<double>(*within_) * stretch >= wait_.lasting - rounding)
    decide(Verdict::met, text_of(wait_) + ": has come");
  else if (end >= wait_.timeout - rounding)
    decide(Verdict::failed, "waited " + number_text(wait_.timeout) + " s for " + text_of(wait_) + where());
}

void Watch::decide(Verdict verdict, std::string reason) {
  if (verdict_ != Verdict::none) return;
  verdict_ = verdict;
  reason_ = std::move(reason);
}

void Watch::give_up(const std::string& why) {
  const std::scoped_lock lock(mutex_);
  decide(Verdict::given_up, why);
}

Watch::Verdict Watch::verdict() const {
  const std::scoped_lock lock(mutex_);
  return verdict_;
}

std::string Watch::reason() const {
  const std::scoped_lock lock(mutex_);
  return reason_;
}

std::string Watch::where() const {
  return last_ ? "; it is " + with_unit(*last_, wait_) + " now" : "";
}

std::string Watch::now() const {
  const std::scoped_lock lock(mutex_);
  return text_of(wait_) + where();
}

}  // namespace ferrobench::server
