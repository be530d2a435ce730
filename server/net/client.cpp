#include "server/net/client.h"

#include <curl/curl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <memory>
#include <system_error>
#include <utility>

#include "base/fields.h"
#include "base/unix_socket.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

// Replies may hold whole reports; the daemon is trusted, but not to fill the memory.
constexpr std::size_t max_reply = 512u << 20;

[[noreturn]] void broken(const std::string& why) {
  throw Error(ErrorCode::io_error, "the connection to the daemon broke",
              Problem{.path = "", .message = why, .hint = "look at the daemon's log"});
}

bool wait_for(int fd, short events, std::chrono::steady_clock::time_point deadline) {
  while (true) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    pollfd item{.fd = fd, .events = events, .revents = 0};
    const int ready = poll(&item, 1, static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, 1 << 30)));
    if (ready > 0) return true;
    if (ready == 0) return false;
    if (errno != EINTR) broken(std::generic_category().message(errno));
  }
}

ErrorCode code_of(int rpc_code, const std::string& name) {
  for (const auto& e : error_table())
    if (e.name == name) return e.code;
  for (const auto& e : error_table())
    if (e.rpc_code == rpc_code) return e.code;
  return rpc_code == -32601 ? ErrorCode::not_found : ErrorCode::invalid_params;
}

Error error_of(const json& error) {
  return failure_of(text_at(error, "message"), error.value("data", json::object()),
                    error.value("code", -32603));
}

// Whoever can write to the folder can listen there, and would be told what is to be done, and could answer
// anything.
void demand_trusted(int fd, const std::string& unix_socket) {
  unsigned user = 0;
  if (is_trusted_peer(fd, &user)) return;
  throw Error(ErrorCode::unauthorized, "another user's program answers in the daemon's place",
              Problem{.message = "belongs to user " + std::to_string(user),
                      .given = unix_socket,
                      .allowed = "user " + std::to_string(geteuid()) + " or root",
                      .hint = "use a data folder that only you can write to (--data), or call as that user"});
}

}  // namespace

Error failure_of(const std::string& message, const json& data, int rpc_code) {
  std::vector<Problem> problems;
  if (data.is_object() && data.contains("problems") && data["problems"].is_array())
    for (const auto& p : data["problems"])
      if (p.is_object())
        problems.push_back({.path = text_at(p, "path"),
                            .message = text_at(p, "message"),
                            .given = p.value("given", json(nullptr)),
                            .allowed = p.value("allowed", json(nullptr)),
                            .unit = text_at(p, "unit"),
                            .hint = text_at(p, "hint")});
  return {code_of(rpc_code, text_at(data, "name")), message, std::move(problems)};
}

std::optional<Client> Client::try_connect(const std::string& unix_socket) {
  const int fd = connect_unix(unix_socket);
  if (fd < 0) return std::nullopt;
  Client client(fd);
  demand_trusted(fd, unix_socket);
  return client;
}

Client Client::connect(const std::string& unix_socket) {
  if (auto client = try_connect(unix_socket)) return std::move(*client);
  throw Error(ErrorCode::device_unavailable, "no daemon is running",
              Problem{.path = "",
                      .message = "nobody listens on the socket",
                      .given = unix_socket,
                      .hint = "start one with 'ferrobench serve'"});
}

Client::~Client() {
  if (fd_ >= 0) close(fd_);
}

Client::Client(Client&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      last_id_(other.last_id_),
      buffer_(std::move(other.buffer_)),
      waiting_(std::move(other.waiting_)) {}

Client& Client::operator=(Client&& other) noexcept {
  std::swap(fd_, other.fd_);
  std::swap(last_id_, other.last_id_);
  std::swap(buffer_, other.buffer_);
  std::swap(waiting_, other.waiting_);
  return *this;
}

void Client::send_line(const std::string& line, Deadline deadline) {
  std::size_t sent = 0;
  while (sent < line.size()) {
    if (!wait_for(fd_, POLLOUT, deadline)) broken("the daemon takes nothing");
    const ssize_t n = send(fd_, line.data() + sent, line.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n < 0 && errno != EINTR && errno != EAGAIN) broken(std::generic_category().message(errno));
    if (n > 0) sent += static_cast<std::size_t>(n);
  }
}

std::optional<json> Client::read_message(Deadline deadline) {
  std::size_t searched = 0;
  while (true) {
    const auto end = buffer_.find('\n', searched);
    if (end != std::string::npos) {
      auto message =
          json::parse(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(end), nullptr, false);
      buffer_.erase(0, end + 1);
      if (!message.is_object()) broken("the daemon sent something that is no JSON-RPC message");
      return message;
    }
    searched = buffer_.size();
    if (searched > max_reply) broken("the reply is too long");
    if (!wait_for(fd_, POLLIN, deadline)) return std::nullopt;
    std::array<char, 64u << 10> chunk;
    const ssize_t n = recv(fd_, chunk.data(), chunk.size(), 0);
    if (n == 0) broken("the daemon closed it");
    if (n < 0 && errno != EINTR) broken(std::generic_category().message(errno));
    if (n > 0) buffer_.append(chunk.data(), static_cast<std::size_t>(n));
  }
}

json Client::call(std::string_view method, const json& params, std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  const auto id = ++last_id_;
  const json request{{"jsonrpc", "2.0"}, {"method", method}, {"params", params}, {"id", id}};
  send_line(request.dump(-1, ' ', false, json::error_handler_t::replace) + "\n", deadline);
  while (auto message = read_message(deadline)) {
    if (message->contains("method")) {
      waiting_.push_back({text_at(*message, "method"), message->value("params", json::object())});
      continue;
    }
    const auto reply_id = message->value("id", json(nullptr));
    if (!reply_id.is_null() && reply_id != id) continue;  // of a call that was given up
    if (message->contains("error")) throw error_of((*message)["error"]);
    if (message->contains("result")) return std::move((*message)["result"]);
    broken("a reply has neither result nor error");
  }
  broken("no reply to " + std::string(method) + " came in time");
}

std::optional<Notification> Client::next(std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (waiting_.empty()) {
    auto message = read_message(deadline);
    if (!message) return std::nullopt;
    if (message->contains("method"))
      waiting_.push_back({text_at(*message, "method"), message->value("params", json::object())});
  }
  auto first = std::move(waiting_.front());
  waiting_.pop_front();
  return first;
}

namespace {

std::size_t keep(const char* data, std::size_t, std::size_t size, std::string* into) {
  if (into->size() + size > max_reply) return 0;
  into->append(data, size);
  return size;
}

[[noreturn]] void unreachable(const Remote& remote, const std::string& why) {
  throw Error(
      ErrorCode::io_error, "the daemon cannot be reached",
      Problem{.path = "/url",
              .message = why,
              .given = remote.url,
              .hint = "check address and port, and name its certificate (--ca) if it signed that itself"});
}

}  // namespace

json call_remote(const Remote& remote, const std::string& method, const json& params) {
  if (!remote.url.starts_with("https://"))
    throw Error(ErrorCode::invalid_params, "the token may not go over the network in plain text",
                Problem{.path = "/url", .given = remote.url, .hint = "an address that begins with https://"});
  const std::unique_ptr<CURL, void (*)(CURL*)> curl(curl_easy_init(), curl_easy_cleanup);
  if (!curl) unreachable(remote, "libcurl cannot start");
  std::unique_ptr<curl_slist, void (*)(curl_slist*)> fields(nullptr, curl_slist_free_all);
  const auto add = [&](const std::string& field) {
    fields.reset(curl_slist_append(fields.release(), field.c_str()));
  };
  add("Authorization: Bearer " + remote.token);
  add("Content-Type: application/json");
  if (!remote.lease.empty()) add("Ferrobench-Lease: " + remote.lease);
  const auto url = remote.url.substr(0, remote.url.find_last_not_of('/') + 1) + "/rpc";
  const auto request = json{{"jsonrpc", "2.0"}, {"method", method}, {"params", params}, {"id", 1}}.dump(
      -1, ' ', false, json::error_handler_t::replace);
  std::string text;
  curl_easy_setopt(curl.get(), CURLOPT_URL, url.c_str());
  curl_easy_setopt(curl.get(), CURLOPT_PROTOCOLS_STR, "https");
  curl_easy_setopt(curl.get(), CURLOPT_SSLVERSION, CURL_SSLVERSION_TLSv1_2);
  if (!remote.ca.empty()) curl_easy_setopt(curl.get(), CURLOPT_CAINFO, remote.ca.c_str());
  curl_easy_setopt(curl.get(), CURLOPT_HTTPHEADER, fields.get());
  curl_easy_setopt(curl.get(), CURLOPT_POSTFIELDS, request.c_str());
  curl_easy_setopt(curl.get(), CURLOPT_POSTFIELDSIZE, static_cast<long>(request.size()));
  curl_easy_setopt(curl.get(), CURLOPT_CONNECTTIMEOUT, 15L);
  curl_easy_setopt(curl.get(), CURLOPT_TIMEOUT, 600L);
  curl_easy_setopt(curl.get(), CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl.get(), CURLOPT_WRITEFUNCTION, keep);
  curl_easy_setopt(curl.get(), CURLOPT_WRITEDATA, &text);
  if (const auto failure = curl_easy_perform(curl.get()); failure != CURLE_OK)
    unreachable(remote, curl_easy_strerror(failure));
  const auto reply = json::parse(text, nullptr, false);
  if (!reply.is_object()) unreachable(remote, "what answers there is no daemon");
  if (reply.contains("error")) throw error_of(reply["error"]);
  if (!reply.contains("result"))
    throw Error(code_of(0, text_at(reply, "name")), text_at(reply, "message"),
                Problem{.hint = text_at(reply, "hint")});
  return reply["result"];
}

}  // namespace ferrobench::server
