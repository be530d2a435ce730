#include "protocols/common/error.h"

#include <array>
#include <utility>

namespace ferrobench {
namespace {

constexpr std::array<ErrorEntry, 18> table{{
    {ErrorCode::invalid_params, -32602, "invalid_params",
     "a parameter is missing, unknown, or out of its range"},
    {ErrorCode::not_found, -32001, "not_found", "nothing has the name or id that was given"},
    {ErrorCode::bad_protocol, -32002, "bad_protocol", "the field program is not valid"},
    {ErrorCode::bad_recording, -32003, "bad_recording", "the file is not a recording, or is damaged"},
    {ErrorCode::bad_model, -32004, "bad_model", "the model file is not valid"},
    {ErrorCode::limit_exceeded, -32005, "limit_exceeded", "the request would pass a limit of the guard"},
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

// Quoted text may come from a file that is not UTF-8.
std::string quoted(const nlohmann::json& value) {
  return value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string text_of(const std::string& message, const std::vector<Problem>& problems) {
  std::string text = message;
  for (const auto& p : problems) {
    text += "\n  " + (p.path.empty() ? std::string{} : p.path + ": ") + p.message;
    if (!p.given.is_null()) text += "; given " + quoted(p.given);
    if (!p.allowed.is_null()) text += "; allowed " + quoted(p.allowed);
    if (!p.unit.empty()) text += " " + p.unit;
    if (!p.hint.empty()) text += " (" + p.hint + ")";
  }
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
