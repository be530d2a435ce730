#include "net_bench.h"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <thread>

namespace ferrobench::server {
namespace {

struct EchoParams {
  nlohmann::json value;
};
template <class Visitor>
void describe(Visitor& visit, EchoParams& p) {
  visit("value", p.value, {.required = true});
}

struct SleepParams {
  double seconds = 0;
};
template <class Visitor>
void describe(Visitor& visit, SleepParams& p) {
  visit("seconds", p.seconds, {.unit = "s", .min = 0, .max = 5, .required = true});
}

}  // namespace

Bench::Bench(ServerOptions options, const std::function<void(Bench&, Content&)>& also) {
  static std::atomic<int> number{0};
  folder = std::filesystem::temp_directory_path() /
           ("ferrobench-" + std::to_string(getpid()) + "-" + std::to_string(++number));
  std::filesystem::create_directories(folder);
  for (int i = 0; i < 300'000; ++i) recording += static_cast<char>(i * 31 + i / 251);
  std::ofstream(folder / "loop.h5", std::ios::binary) << recording;

  rpc.add<NoParams>({.name = "count", .doc = "counts", .role = Role::control},
                    [this](const NoParams&) -> nlohmann::json { return ++counted; });
  rpc.add<NoParams>({.name = "stop", .doc = "is for everybody", .role = Role::stop},
                    [this](const NoParams&, CallContext& c) { ++(c.again ? stopped_again : stopped); });
  rpc.add<SleepParams>({.name = "view", .doc = "is heavy", .lane = Lane::heavy},
                       [this](const SleepParams& p) {
                         most_viewing = std::max<int>(most_viewing, ++viewing);
                         std::this_thread::sleep_for(std::chrono::duration<double>(p.seconds));
                         --viewing;
                       });
  rpc.add<EchoParams>({.name = "echo", .doc = "gives back"}, [](const EchoParams& p) { return p.value; });
  rpc.add<SleepParams>({.name = "sleep", .doc = "takes its time"}, [](const SleepParams& p) {
    std::this_thread::sleep_for(std::chrono::duration<double>(p.seconds));
  });
  rpc.add<NoParams>({.name = "who", .doc = "names the caller"},
                    [](const NoParams&, CallContext& c) -> nlohmann::json {
                      return {c.client, c.lease};
                    });
  hub.add_topic({.name = "run", .doc = "state of the run"});
  hub.add_topic({.name = "samples", .doc = "samples"});
  add_subscription_methods(rpc, hub);
  add_discovery(rpc, hub, "0");

  options.port = 0;
  options.token = token;
  options.unix_socket = socket_path();
  Content content;
  content.asset = [](std::string_view path) -> std::optional<Asset> {
    static const std::string large(32u << 20, 'x');
    if (path == "/large") return Asset{large, "text/plain"};
    if (path != "/") return std::nullopt;
    return Asset{"<!doctype html><title>bench</title>", "text/html; charset=utf-8"};
  };
  content.recording = [this](const std::string& name) -> std::optional<std::string> {
    return name == "loop.h5" ? std::optional((folder / name).string()) : std::nullopt;
  };
  content.disconnected = [this](const CallContext&) { ++gone; };
  if (also) also(*this, content);
  server = std::make_unique<Server>(rpc, hub, options, std::move(content));
}

Bench::~Bench() {
  server.reset();
  std::filesystem::remove_all(folder);
}

int connect_tcp(std::uint16_t port) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  return fd;
}

void send_all(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t n = send(fd, text.data(), text.size(), MSG_NOSIGNAL);
    if (n <= 0) break;
    text.remove_prefix(static_cast<std::size_t>(n));
  }
}

std::string read_all(int fd) {
  const timeval patience{.tv_sec = 20, .tv_usec = 0};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  std::string out;
  std::array<char, 4096> chunk{};
  while (true) {
    const ssize_t n = recv(fd, chunk.data(), chunk.size(), 0);
    if (n <= 0) {
      EXPECT_FALSE(n < 0 && errno == EAGAIN) << "the daemon never closed the connection";
      return out;
    }
    out.append(chunk.data(), static_cast<std::size_t>(n));
  }
}

std::string raw_exchange(std::uint16_t port, const std::string& text) {
  const int fd = connect_tcp(port);
  send_all(fd, text);
  auto out = read_all(fd);
  close(fd);
  return out;
}

std::string frame(int first, std::string_view payload) {
  constexpr std::string_view mask = "\x12\x34\x56\x78";
  std::string out(1, static_cast<char>(first));
  const auto size = payload.size();
  const int bytes = size < 126 ? 0 : size < 65536 ? 2 : 8;  // of the extended length
  out += static_cast<char>(0x80 | (bytes == 0 ? static_cast<int>(size) : bytes == 2 ? 126 : 127));
  for (int i = bytes - 1; i >= 0; --i) out += static_cast<char>(size >> (8 * i));
  out += mask;
  for (std::size_t i = 0; i < size; ++i) out += static_cast<char>(payload[i] ^ mask[i % 4]);
  return out;
}

Reply parse_reply(const std::string& text) {
  Reply reply;
  const auto end = text.find("\r\n\r\n");
  if (!text.starts_with("HTTP/1.1 ") || end == std::string::npos) return reply;
  reply.status = std::stoi(text.substr(9, 3));
  reply.body = text.substr(end + 4);
  for (auto at = text.find("\r\n") + 2; at < end + 2;) {
    const auto line_end = text.find("\r\n", at);
    const auto colon = text.find(": ", at);
    reply.headers[text.substr(at, colon - at)] = text.substr(colon + 2, line_end - colon - 2);
    at = line_end + 2;
  }
  return reply;
}

Reply http(const Bench& bench, const Head& head) {
  std::string text = head.method + " " + head.target +
                     " HTTP/1.1\r\nHost: " + (head.host.empty() ? bench.host() : head.host) +
                     "\r\nConnection: close\r\n" + head.headers;
  if (!head.body.empty()) text += "Content-Length: " + std::to_string(head.body.size()) + "\r\n";
  return parse_reply(raw_exchange(bench.port(), text + "\r\n" + head.body));
}

}  // namespace ferrobench::server
