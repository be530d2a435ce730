// What a plan waits for before each of its runs: that a channel stays within a tolerance of a value for a
// time.
//
//     {"channel": "force", "value": 98, "tolerance": 2, "unit": "N", "for_s": 10, "timeout_s": 600}
//
// A device gives samples only while a program plays. So waiting is a run of its own: a hold at zero field,
// through guard and journal like any other, which is stopped as soon as the condition holds. Its recording is
// kept only where it does not come to that. What counts are means over 0.1 s: whole periods of the mains' 50
// and 60 Hz, so that hum and noise do not break what holds.
#pragma once

#include <mutex>
#include <optional>
#include <string>

#include "base/fields.h"
#include "recordings/format/parts.h"

namespace ferrobench::server {

enum class Watched { field, charge, displacement, force };
std::span<const std::pair<Watched, std::string_view>> enum_names(Watched);

struct Wait {
  Watched channel = Watched::force;
  double value = 0, tolerance = 0;  // in `unit`
  std::string unit{};
  double lasting = 10, timeout = 600;  // s
};
template <class Visitor>
void describe(Visitor& visit, Wait& w) {
  constexpr double day = 86'400;  // a recording of a day has 0.5 GB
  visit("channel", w.channel, {.required = true, .doc = "that is measured"});
  visit("value", w.value, {.required = true, .doc = "where it must be, in the unit below"});
  visit("tolerance", w.tolerance,
        {.min = 0, .exclusive_min = true, .required = true, .doc = "how far from there, likewise"});
  visit("unit", w.unit, {.doc = R"(of both, for example "N", "um" or "kV/mm"; "": that of SI)"});
  visit("for_s", w.lasting, {.unit = "s", .min = 0.1, .max = day, .doc = "how long without a break"});
  visit("timeout_s", w.timeout,
        {.unit = "s",
         .min = 0.1,
         .max = day,
         .doc = "after so long the run has failed without having begun; stop_after_failures says whether "
                "the queue goes on"});
}

// Adds what its fields alone do not say; pointers begin with `path`.
void check_wait(const Wait& wait, const std::string& path, std::vector<Problem>& problems);
// "force within 2 N of 98 N for 10 s"
std::string text_of(const Wait& wait);
// The hold, for the specimen and load of this protocol.
nlohmann::json hold_of(const Wait& wait, nlohmann::json protocol);

// Whether it has come, from the rows of the hold. For two threads: one that has the rows, one that waits.
class Watch {
 public:
  enum class Verdict { none, met, failed, given_up };

  explicit Watch(const Wait& wait);
  void see(const recordings::Rows& rows);
  void give_up(const std::string& why);
  Verdict verdict() const;
  std::string reason() const;  // of the verdict: why the hold ends; "" while it goes on
  std::string now() const;     // what is waited for, and where the channel is

 private:
  void take_mean();
  std::string where() const;
  void decide(Verdict verdict, std::string reason);

  const Wait wait_;
  const double si_;  // in one of its unit
  mutable std::mutex mutex_;
  Verdict verdict_ = Verdict::none;
  std::string reason_;
  std::int64_t stretch_ = 0;  // of 0.1 s, that is summed up now
  double sum_ = 0;
  std::size_t count_ = 0;
  std::optional<double> last_;          // mean, in its unit
  std::optional<std::int64_t> within_;  // first of the stretches in a row that are
};

}  // namespace ferrobench::server
