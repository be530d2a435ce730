// What the server's connections share. Only for the few sources that do the networking: it pulls in Asio.
// Everything here belongs to the one thread of `io`, except what runs on the workers.
#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/thread_pool.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "server/net/admission.h"
#include "server/net/server.h"
#include "server/net/tls.h"

namespace ferrobench::server {

struct Service;

// One connection. It lives as long as an operation of it is under way.
class Session {
 public:
  explicit Session(Service& service);
  virtual ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  // Closes as soon as what is under way is answered.
  virtual void stop() = 0;
  virtual bool local() const { return false; }  // came by the Unix socket

 protected:
  Service& service_;
};

struct Service {
  const Dispatcher& dispatcher;
  Hub& hub;
  ServerOptions options;
  Content content;
  std::shared_ptr<boost::asio::ssl::context> tls;  // null: plain
  std::optional<Admission> admission;              // once the port is known
  std::set<Session*> sessions;
  bool stopping = false;
  std::uint64_t connections = 0;  // ever accepted, to name them
  std::atomic<std::size_t> calls_waiting{0};
  boost::asio::io_context io{1};
  boost::asio::thread_pool workers;

  Service(const Dispatcher& d, Hub& h, const ServerOptions& o, Content c);

  using Work = std::function<std::optional<std::string>()>;
  using Done = std::function<void(std::optional<std::string>)>;
  // Does the work on a worker; `done` gets its text on the io thread.
  void run(Work work, Done done);
  // The same with what the dispatcher replies to the text.
  void call(std::string text, std::shared_ptr<CallContext> context, Done done);
};

// A full house is told so, and closed.
void start_http(Service& service, boost::asio::ip::tcp::socket socket, bool full);
void start_unix(Service& service, boost::asio::local::stream_protocol::socket socket, bool full);

}  // namespace ferrobench::server
