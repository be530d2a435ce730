// A small daemon for the tests of the door: a few methods, two topics, one page, one recording.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <thread>

#include "server/net/server.h"
#include "server/rpc/discover.h"
#include "server/rpc/subscribe.h"

namespace ferrobench::server {

class Bench {
 public:
  // `also` may change what the server is given.
  explicit Bench(ServerOptions options = {}, const std::function<void(Bench&, Content&)>& also = nullptr);
  ~Bench();

  std::uint16_t port() const { return server->port(); }
  std::string socket_path() const { return folder / "rpc.sock"; }
  std::string host() const { return "127.0.0.1:" + std::to_string(port()); }

  static inline const std::string token = std::string(32, 'a') + std::string(32, '5');

  std::filesystem::path folder;
  std::string recording;  // the bytes of "loop.h5"
  std::atomic<int> counted{0};
  std::atomic<int> gone{0};
  std::atomic<int> stopped{0}, stopped_again{0};
  std::atomic<int> viewing{0}, most_viewing{0};
  Hub hub;
  Dispatcher rpc;
  std::unique_ptr<Server> server;
};

struct Reply {
  int status = 0;  // 0: the connection was closed without a word
  std::map<std::string, std::string> headers;
  std::string body;
};

int connect_tcp(std::uint16_t port);
void send_all(int fd, std::string_view text);
std::string read_all(int fd);  // until the daemon closes
// Sends the text as it is, and reads until the daemon closes.
std::string raw_exchange(std::uint16_t port, const std::string& text);
Reply parse_reply(const std::string& text);

struct Head {
  std::string method = "POST";
  std::string target = "/rpc";
  std::string host = "";  // "": the right one
  std::string headers = "Authorization: Bearer " + Bench::token + "\r\nContent-Type: application/json\r\n";
  std::string body = R"({"jsonrpc":"2.0","method":"count","id":1})";
};
Reply http(const Bench& bench, const Head& head);

// A frame as a browser sends it: `first` is FIN, reserved bits and opcode; masked.
std::string frame(int first, std::string_view payload);

template <class Condition>
bool eventually(Condition condition) {
  for (int i = 0; i < 1000 && !condition(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return condition();
}

}  // namespace ferrobench::server
