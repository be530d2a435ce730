// A blocking client on the daemon's Unix socket, for the command line. Not for several threads at once.
#pragma once

#include <chrono>
#include <deque>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"

namespace ferrobench::server {

struct Notification {
  std::string topic;  // "run", ..., or "gap" {topic, lost}
  nlohmann::json params;
};

// The Error that a daemon told of: by {name, problems}, where the name is one of the table, else by the code.
Error failure_of(const std::string& message, const nlohmann::json& data, int rpc_code = -32603);

class Client {
 public:
  // Throws Error(device_unavailable) if no daemon listens there, Error(unauthorized) if another user's
  // program does (root's may).
  static Client connect(const std::string& unix_socket);
  // Nothing if no daemon listens there.
  static std::optional<Client> try_connect(const std::string& unix_socket);
  ~Client();
  Client(Client&& other) noexcept;
  Client& operator=(Client&& other) noexcept;

  // The result. A failure is thrown as the Error that the daemon raised, with its problems; Error(io_error)
  // if the connection breaks or nothing comes within `timeout`.
  nlohmann::json call(std::string_view method, const nlohmann::json& params = nlohmann::json::object(),
                      std::chrono::milliseconds timeout = std::chrono::minutes(10));

  // The next notification of a subscribed topic; nothing if none comes within `timeout`.
  std::optional<Notification> next(std::chrono::milliseconds timeout);

 private:
  explicit Client(int fd) : fd_(fd) {}
  using Deadline = std::chrono::steady_clock::time_point;
  void send_line(const std::string& line, Deadline deadline);
  std::optional<nlohmann::json> read_message(Deadline deadline);

  int fd_ = -1;
  std::int64_t last_id_ = 0;
  std::string buffer_;
  std::deque<Notification> waiting_;
};

// A daemon on another machine.
struct Remote {
  std::string url;  // "https://bench.lab:8377"
  std::string ca;   // PEM file of the certificate that its own is signed by, or of its own; "": the system's
  std::string token;    // of that daemon
  std::string lease{};  // presented unless ""
};

// One call by HTTPS; errors as those of Client::call(). Error(invalid_params) for an address that would carry
// the token in plain text, Error(unauthorized) where the daemon refuses, Error(io_error) where it cannot be
// reached or trusted.
nlohmann::json call_remote(const Remote& remote, const std::string& method, const nlohmann::json& params);

}  // namespace ferrobench::server
