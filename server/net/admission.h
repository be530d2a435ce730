// Who may talk: looks at the head of an HTTP request and says where it may go, or why not. Nothing else of
// the request has been read by then, so a refused one changes nothing.
//
// Checked in this order: Host and Origin against the allowlist (a page of another site that resolves its name
// to loopback has the wrong Host), path, method, token, content type.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "base/error.h"

namespace ferrobench::server {

// Header fields that came more than once are joined by ", " and so match nothing.
struct RequestHead {
  std::string method;
  std::string target;
  std::string host;
  std::optional<std::string> origin;  // only browsers send it
  std::string authorization;
  std::string cookie;
  std::string content_type;
  bool upgrade = false;  // asks for a WebSocket, in full
};

enum class Route { rpc_call, rpc_socket, recording, metrics, page, sign_in };

struct Admitted {
  Route route = Route::page;
  std::string path;  // decoded; for a recording its name
};

struct Refusal {
  unsigned status = 400;
  ErrorCode code = ErrorCode::invalid_params;
  std::string message{};
  std::string hint{};
  std::vector<std::pair<std::string, std::string>> headers{};

  nlohmann::json body() const;  // {name, message, hint}
};

class Admission {
 public:
  // Beside the loopback names, `extra_hosts` (without port) are allowed.
  Admission(std::string token, std::uint16_t port, const std::vector<std::string>& extra_hosts,
            bool tls = false);

  std::variant<Admitted, Refusal> admit(const RequestHead& head) const;
  // Begins a session of the page, and gives the cookie that stands for it. Browsers send it to the other
  // ports of this host as well; so it is not the token, has the port in its name, and ends by itself. So many
  // sessions are kept; then the oldest ends.
  std::string sign_in();
  std::string cookie_name() const;

  static constexpr std::chrono::hours session_lifetime{7 * 24};
  static constexpr std::size_t most_sessions = 64;

 private:
  using Clock = std::chrono::steady_clock;
  struct SignedIn {
    std::string secret;
    Clock::time_point end;
  };

  bool shows_token(const RequestHead& head, std::string_view query) const;
  bool shows_session(const RequestHead& head) const;

  std::string token_;
  std::uint16_t port_;
  bool tls_;
  std::deque<SignedIn> sessions_;   // the oldest first
  std::vector<std::string> hosts_;  // "name:port", lower case
};

}  // namespace ferrobench::server
