#include "server/net/admission.h"

#include <algorithm>
#include <cctype>

#include "server/net/token.h"

namespace ferrobench::server {
namespace {

std::string lower(std::string_view text) {
  std::string out(text);
  std::ranges::transform(out, out.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

bool contains(const std::vector<std::string>& list, const std::string& item) {
  return std::ranges::find(list, item) != list.end();
}

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// The path of a target with its %XX decoded; nothing if it is malformed or tries to leave its folder.
std::optional<std::string> decoded_path(std::string_view raw) {
  if (raw.empty() || raw.front() != '/') return std::nullopt;
  std::string path;
  for (std::size_t i = 0; i < raw.size(); ++i) {
    char c = raw[i];
    if (c == '%') {
      const int high = i + 1 < raw.size() ? hex_value(raw[i + 1]) : -1;
      const int low = i + 2 < raw.size() ? hex_value(raw[i + 2]) : -1;
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      if (c == '/') return std::nullopt;
      i += 2;
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f || c == '\\') return std::nullopt;
    path += c;
  }
  // No segment may begin with a dot: neither "..", nor hidden files.
  return path.find("/.") == std::string::npos ? std::optional(path) : std::nullopt;
}

std::string_view query_value(std::string_view query, std::string_view key) {
  while (!query.empty()) {
    const auto end = std::min(query.find('&'), query.size());
    const auto item = query.substr(0, end);
    if (item.size() > key.size() && item.starts_with(key) && item[key.size()] == '=')
      return item.substr(key.size() + 1);
    query.remove_prefix(std::min(end + 1, query.size()));
  }
  return {};
}

std::string_view cookie_value(std::string_view cookies, std::string_view name) {
  while (!cookies.empty()) {
    const auto start = std::min(cookies.find_first_not_of(' '), cookies.size());
    cookies.remove_prefix(start);
    const auto end = std::min(cookies.find(';'), cookies.size());
    const auto item = cookies.substr(0, end);
    if (item.size() > name.size() && item.starts_with(name) && item[name.size()] == '=')
      return item.substr(name.size() + 1);
    cookies.remove_prefix(std::min(end + 1, cookies.size()));
  }
  return {};
}

bool is_json(std::string_view content_type) {
  auto type = lower(content_type.substr(0, content_type.find(';')));
  type.erase(type.find_last_not_of(" \t") + 1);
  return type == "application/json" || type == "application/json-rpc";
}

constexpr std::string_view recordings_prefix = "/recordings/";

}  // namespace

nlohmann::json Refusal::body() const {
  return {{"name", entry(code).name}, {"message", message}, {"hint", hint}};
}

Admission::Admission(std::string token, std::uint16_t port, const std::vector<std::string>& extra_hosts,
                     bool tls)
    : token_(std::move(token)), port_(port), tls_(tls) {
  std::vector<std::string> names{"127.0.0.1", "localhost", "[::1]"};
  for (const auto& host : extra_hosts) names.push_back(lower(host));
  for (const auto& name : names) {
    hosts_.push_back(name + ":" + std::to_string(port));
    if (port == (tls ? 443 : 80)) hosts_.push_back(name);
  }
}

std::string Admission::cookie_name() const {
  return "ferrobench_" + std::to_string(port_);
}

std::string Admission::sign_in() {
  if (sessions_.size() == most_sessions) sessions_.pop_front();
  sessions_.push_back({random_secret(), Clock::now() + session_lifetime});
  const auto seconds = std::chrono::seconds(session_lifetime).count();
  return cookie_name() + "=" + sessions_.back().secret + "; Path=/; Max-Age=" + std::to_string(seconds) +
         "; HttpOnly; SameSite=Strict" + (tls_ ? "; Secure" : "");
}

bool Admission::shows_session(const RequestHead& head) const {
  const auto given = cookie_value(head.cookie, cookie_name());
  return std::ranges::any_of(sessions_, [&](const SignedIn& session) {
    return equal_secret(given, session.secret) && Clock::now() < session.end;
  });
}

bool Admission::shows_token(const RequestHead& head, std::string_view query) const {
  constexpr std::string_view scheme = "bearer ";
  const std::string_view authorization = head.authorization;
  if (lower(authorization.substr(0, scheme.size())) == scheme)
    return equal_secret(authorization.substr(scheme.size()), token_);
  return shows_session(head) || equal_secret(query_value(query, "token"), token_);
}

std::variant<Admitted, Refusal> Admission::admit(const RequestHead& head) const {
  if (!contains(hosts_, lower(head.host)))
    return Refusal{403,
                   ErrorCode::unauthorized,
                   "the Host header names no host of this daemon",
                   "call it as 127.0.0.1:" + std::to_string(port_) + ", or start it with the name allowed",
                   {}};
  const std::string_view scheme = tls_ ? "https://" : "http://";
  if (head.origin && (!head.origin->starts_with(scheme) ||
                      !contains(hosts_, lower(std::string_view(*head.origin).substr(scheme.size())))))
    return Refusal{403,
                   ErrorCode::unauthorized,
                   "the Origin header names another site",
                   "only the daemon's own page may call it from a browser",
                   {}};

  const std::string_view target = head.target;
  const auto mark = std::min(target.find('?'), target.size());
  const auto query = target.substr(std::min(mark + 1, target.size()));
  const auto path = decoded_path(target.substr(0, mark));
  if (!path)
    return Refusal{400,
                   ErrorCode::invalid_params,
                   "the path is not valid",
                   "a path begins with / and has no part that begins with a dot",
                   {}};

  Admitted admitted{.route = Route::page, .path = *path};
  std::string allowed = "GET";
  if (*path == "/rpc") {
    allowed = "GET, POST";
    admitted.route = head.method == "GET" ? Route::rpc_socket : Route::rpc_call;
  } else if (path->starts_with(recordings_prefix)) {
    admitted = {.route = Route::recording, .path = path->substr(recordings_prefix.size())};
  } else if (*path == "/metrics") {
    admitted.route = Route::metrics;
  } else if (*path == "/" && !query_value(query, "token").empty()) {
    admitted.route = Route::sign_in;
  }
  if (head.method != "GET" && !(admitted.route == Route::rpc_call && head.method == "POST"))
    return Refusal{405,
                   ErrorCode::invalid_params,
                   "this path does not take the method " + head.method.substr(0, 20),
                   "it takes " + allowed,
                   {{"Allow", allowed}}};
  if (!shows_token(head, admitted.route == Route::sign_in ? query : std::string_view{}))
    return Refusal{
        401,
        ErrorCode::unauthorized,
        "the token is missing or wrong",
        "send 'Authorization: Bearer TOKEN' with the text of the daemon's token file, or open the page's "
        "address as the daemon printed it",
        {{"WWW-Authenticate", "Bearer"}}};
  if (admitted.route == Route::rpc_call && !is_json(head.content_type))
    return Refusal{415,
                   ErrorCode::invalid_params,
                   "the content type is not JSON",
                   "send 'Content-Type: application/json'",
                   {}};
  if (admitted.route == Route::rpc_socket && !head.upgrade)
    return Refusal{426,
                   ErrorCode::invalid_params,
                   "GET /rpc opens a WebSocket and nothing else",
                   "call by POST, or upgrade the connection (version 13, with a key of 16 bytes)",
                   {{"Upgrade", "websocket"}, {"Sec-WebSocket-Version", "13"}}};
  return admitted;
}

}  // namespace ferrobench::server
