#include "recordings/format/iso_time.h"

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <regex>

namespace ferrobench::recordings {
namespace {

using Moment = std::chrono::sys_time<std::chrono::microseconds>;

std::string text_of(Moment moment) {
  using namespace std::chrono;
  const auto day = floor<days>(moment);
  const year_month_day date(day);
  const hh_mm_ss clock(moment - day);
  std::array<char, 64> text{};
  static_cast<void>(std::snprintf(
      text.data(), text.size(), "%04d-%02u-%02uT%02ld:%02ld:%02ld.%06ldZ", static_cast<int>(date.year()),
      static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
      static_cast<long>(clock.hours().count()), static_cast<long>(clock.minutes().count()),
      static_cast<long>(clock.seconds().count()), static_cast<long>(clock.subseconds().count())));
  return text.data();
}

}  // namespace

std::string iso_now() {
  return text_of(std::chrono::floor<std::chrono::microseconds>(std::chrono::system_clock::now()));
}

std::optional<std::string> iso_after(const std::string& start, double seconds) {
  using namespace std::chrono;
  static const std::regex form(
      R"((\d{4})-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)(\.\d{1,9})?(?:Z|([+-])(\d\d):?(\d\d)))");
  std::smatch part;
  if (start.size() > 64 || !std::regex_match(start, part, form)) return std::nullopt;
  if (!(std::abs(seconds) < 1e9)) return std::nullopt;
  const auto number = [&](std::size_t i) { return part[i].matched ? std::stoi(part[i].str()) : 0; };
  const year_month_day date{year(number(1)), month(static_cast<unsigned>(number(2))),
                            day(static_cast<unsigned>(number(3)))};
  if (!date.ok()) return std::nullopt;
  const double fraction = part[7].matched ? std::stod("0" + part[7].str()) : 0;
  const auto zone = minutes(60 * number(9) + number(10)) * (part[8].str() == "-" ? -1 : 1);
  Moment moment =
      sys_days(date) + hours(number(4)) + minutes(number(5)) + std::chrono::seconds(number(6)) - zone;
  moment += microseconds(std::llround((fraction + seconds) * 1e6));
  return text_of(moment);
}

}  // namespace ferrobench::recordings
