// The one table of errors. A code's name is what a client may rely on; its number is the JSON-RPC error code.
#pragma once

#include <exception>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ferrobench {

enum class ErrorCode {
  invalid_params,
  not_found,
  bad_protocol,
  bad_recording,
  bad_model,
  limit_exceeded,
  interlock_open,
  device_unavailable,
  device_lost,
  busy,
  bad_state,
  not_controller,
  unauthorized,
  io_error,
  disk_full,
  cancelled,
  numerical,
  internal,
};

struct ErrorEntry {
  ErrorCode code;
  int rpc_code;
  std::string_view name;
  std::string_view meaning;
};

// Every code once, in the order of the enumeration.
std::span<const ErrorEntry> error_table();
const ErrorEntry& entry(ErrorCode code);

// One thing wrong with what was given. `path` is a JSON pointer into it ("/segments/3/rate"), "" for the
// whole.
struct Problem {
  std::string path{};
  std::string message{};
  nlohmann::json given = nullptr;
  nlohmann::json allowed = nullptr;
  std::string unit{};
  std::string hint{};
};

nlohmann::json to_json(const Problem& problem);

// A failure that the user or the outside world caused. Programmer errors are assertions instead.
class Error : public std::exception {
 public:
  Error(ErrorCode code, std::string message, std::vector<Problem> problems = {});
  Error(ErrorCode code, std::string message, Problem problem)
      : Error(code, std::move(message), std::vector<Problem>{std::move(problem)}) {}

  ErrorCode code() const { return code_; }
  const std::string& message() const { return message_; }
  const std::vector<Problem>& problems() const { return problems_; }

  // The message, then every problem on a line of its own.
  const char* what() const noexcept override { return text_.c_str(); }

  // {name, problems: [{path, message, given, allowed, unit, hint}]}
  nlohmann::json data() const;

 private:
  ErrorCode code_;
  std::string message_;
  std::vector<Problem> problems_;
  std::string text_;
};

}  // namespace ferrobench
