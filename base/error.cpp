#include "base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <utility>

#include "base/visible.h"

namespace ferrobench {
namespace {

constexpr std::array<ErrorEntry, 18> table{{
    {ErrorCode::invalid_params, -32602, "invalid_params",
     "a parameter is missing, unknown, or out of its range"},
    {ErrorCode::not_found, -32001, "not_found", "nothing has the name or id that was given"},
    {ErrorCode::bad_protocol, -32002, "bad_protocol", "the field program is not valid"},
    {ErrorCode::bad_recording, -32003, "bad_recording", "the file is not a recording, or is damaged"},
    {ErrorCode::bad_model, -32004, "bad_model", "the model file is not valid"},
    {ErrorCode::limit_exceeded, -32005, "limit_exceeded", "the request goes beyond a limit of the guard"},
    {ErrorCode::interlock_open, -32006, "interlock_open", "the interlock is open"},
    {ErrorCode::device_unavailable, -32007, "device_unavailable", "the device is not there or not permitted"},
    {ErrorCode::device_lost, -32008, "device_lost", "the device stopped answering"},
    {ErrorCode::busy, -32009, "busy", "a run is in progress"},
    {ErrorCode::bad_state, -32010, "bad_state", "the run's state does not allow this"},
    {ErrorCode::not_controller, -32011, "not_controller", "another client holds the lease"},
    {ErrorCode::unauthorized, -32012, "unauthorized", "the token, host or origin was refused"},
    {ErrorCode::io_error, -32013, "io_error", "a file could not be read or written"},
    {ErrorCode::disk_full, -32014, "disk_full", "there is no room left for the file"},
    {ErrorCode::cancelled, -32015, "cancelled", "the job was cancelled"},
    {ErrorCode::numerical, -32016, "numerical", "the computation did not converge"},
    {ErrorCode::internal, -32603, "internal", "a defect of the program"},
}};

// Values as people write them; JSON is for programs. Quoted text may come from a file that is not UTF-8, and
// is as long as its author liked.
std::string in_words(const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) {
    std::array<char, 32> text{};
    static_cast<void>(std::snprintf(text.data(), text.size(), "%.9g", value.get<double>()));
    return text.data();
  }
  if (value.is_object()) return "an object";
  if (value.is_array()) {
    // A row of numbers can be shown; what is longer or deeper is named.
    const bool row = value.size() <= 8 && std::ranges::all_of(value, &nlohmann::json::is_primitive);
    if (!row) return "a list of " + std::to_string(value.size());
    std::string text = "[";
    for (const auto& item : value) text += (text.size() > 1 ? ", " : "") + in_words(item);
    return text + "]";
  }
  return value.dump();
}

std::string given_in_words(const nlohmann::json& given) {
  return given.is_string() ? '"' + in_words(given) + '"' : in_words(given);
}

// {from, to}, {above, to}, ...: the numbers that are let in.
std::string range_in_words(const nlohmann::json& range) {
  const auto bound = [&range](const char* key) {
    const auto found = range.find(key);
    return found == range.end() ? std::string{} : in_words(*found);
  };
  const auto from = bound("from"), above = bound("above"), to = bound("to"), below = bound("below");
  if (!from.empty() && !to.empty()) return from + " to " + to;
  std::string text;
  const auto add = [&text](const char* word, const std::string& number) {
    if (!number.empty()) text += (text.empty() ? "" : ", ") + std::string(word) + number;
  };
  add("at least ", from);
  add("above ", above);
  add("at most ", to);
  add("below ", below);
  return text;
}

std::string list_in_words(const nlohmann::json& names) {
  constexpr std::size_t most = 40;  // a list that nobody reads helps nobody
  const std::size_t shown = std::min(names.size(), most), left = names.size() - shown;
  std::string text;
  for (std::size_t i = 0; i < shown; ++i) {
    const bool last = i + 1 == shown && left == 0;
    // A comma among commas is none that one reads.
    const auto name = in_words(names[i]);
    const bool mark =
        !name.empty() && std::ranges::none_of(name, [](unsigned char c) { return std::isalnum(c); });
    text += (i == 0 ? "" : last ? " or " : ", ") + (mark ? '"' + name + '"' : name);
  }
  return left == 0 ? text : text + " and " + std::to_string(left) + " more";
}

std::string allowed_in_words(const nlohmann::json& allowed) {
  if (allowed.is_array()) return list_in_words(allowed);
  if (!allowed.is_object()) return in_words(allowed);
  const auto range = range_in_words(allowed);
  return range.empty() ? "an object" : range;
}

// One line: where, what, what was given; the guess before the list that it is taken from; else what to do
// last.
std::string text_of(const Problem& p) {
  const auto unit = p.unit.empty() ? std::string{} : " " + p.unit;
  std::string text = p.path;
  const auto join = [&text](const std::string& by, const std::string& part) {
    if (!part.empty()) text += (text.empty() ? "" : by) + part;
  };
  join(": ", p.message);
  if (!p.given.is_null()) join(": ", given_in_words(p.given) + (p.given.is_string() ? "" : unit));
  // Text in place of a number may name a unit of its own.
  if (p.given.is_string() && p.allowed.is_null() && !unit.empty()) join("; ", "its unit is" + unit);
  const bool guessed = p.hint.starts_with("did you mean");
  if (guessed) join("; ", p.hint);
  if (!p.allowed.is_null()) join(guessed ? " Allowed: " : "; allowed: ", allowed_in_words(p.allowed) + unit);
  if (!guessed && !p.hint.empty()) text += " (" + p.hint + ")";
  return text;
}

std::string text_of(const std::string& message, const std::vector<Problem>& problems) {
  std::string text = visible(message);
  for (const auto& p : problems) text += "\n  " + visible(text_of(p));
  return text;
}

}  // namespace

std::span<const ErrorEntry> error_table() {
  return table;
}

const ErrorEntry& entry(ErrorCode code) {
  return table.at(static_cast<std::size_t>(code));
}

nlohmann::json to_json(const Problem& p) {
  nlohmann::json out{{"path", p.path}, {"message", p.message}};
  if (!p.given.is_null()) out["given"] = p.given;
  if (!p.allowed.is_null()) out["allowed"] = p.allowed;
  if (!p.unit.empty()) out["unit"] = p.unit;
  if (!p.hint.empty()) out["hint"] = p.hint;
  return out;
}

Error::Error(ErrorCode code, std::string message, std::vector<Problem> problems)
    : code_(code),
      message_(std::move(message)),
      problems_(std::move(problems)),
      text_(text_of(message_, problems_)) {}

nlohmann::json Error::data() const {
  nlohmann::json out{{"name", entry(code_).name}, {"problems", nlohmann::json::array()}};
  for (const auto& p : problems_) out["problems"].push_back(to_json(p));
  return out;
}

}  // namespace ferrobench
