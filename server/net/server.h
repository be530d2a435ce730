// The daemon's door: HTTP POST /rpc, WebSocket /rpc, a Unix socket (one JSON text a line), the page and
// downloads of recordings. It decides who may talk (admission.h) and hands what they say to the dispatcher.
//
// One thread does all input and output; calls run on a few workers, in order per connection. A lease held by
// a client that calls by HTTP is presented in the header Ferrobench-Lease.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/net/admission.h"
#include "server/net/options.h"
#include "server/rpc/dispatcher.h"
#include "server/rpc/hub.h"

namespace ferrobench::server {

// A file of the page, built into the program.
struct Asset {
  std::string_view content;       // lives as long as the server
  std::string_view content_type;  // "text/html; charset=utf-8"
};

// How busy the door is.
struct Load {
  std::size_t connections = 0;
  std::size_t calls_waiting = 0;  // for a worker
};

struct Content {
  std::function<std::optional<Asset>(std::string_view path)> asset{};              // "/", "/app.js"
  std::function<std::optional<std::string>(const std::string& name)> recording{};  // name -> path of the file
  std::function<void(const CallContext& gone)> disconnected{};  // a WebSocket or Unix client left
  // A request was refused; may not wait. `request` is "GET /path", without what may hold a token.
  std::function<void(std::string_view client, std::string_view request, const Refusal&)> refused{};
  std::function<std::string(const Load&)> metrics{};  // GET /metrics, in Prometheus text format
};

class Server {
 public:
  // Binds and starts to serve. Throws Error(invalid_params) for bad options, Error(busy) if the port or the
  // Unix socket is taken. Dispatcher and hub must outlive the server. Callbacks come from the server's
  // threads.
  Server(const Dispatcher& dispatcher, Hub& hub, const ServerOptions& options, Content content);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  std::uint16_t port() const;
  // Whether the thread that does all input and output comes round within that time.
  bool answers(std::chrono::milliseconds within) const;
  // Takes no new calls, lets those under way reply (up to stop_timeout), closes every connection. Idempotent.
  void stop();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace ferrobench::server
