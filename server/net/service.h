// What the server's connections share. Only for the few sources that do the networking: it pulls in Asio.
// Everything here belongs to the one thread of `io`, except what runs on the workers.
#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/thread_pool.hpp>
#include <cstdint>
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
  explicit Session(Service& service, std::string address = "");
  virtual ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  // Closes as soon as what is under way is answered.
  virtual void stop() = 0;
  virtual bool local() const { return false; }  // came by the Unix socket
  // A stranger has shown no token yet, and gives way to others.
  bool stranger() const { return !trusted_ && !local(); }
  const std::string& address() const { return address_; }
  std::uint64_t number() const { return number_; }
  // Closes at once.
  void leave() {
    leaving_ = true;
    drop();
  }
  bool leaving() const { return leaving_; }

 protected:
  virtual void drop() {}

  Service& service_;
  bool trusted_ = false;

 private:
  bool leaving_ = false;
  std::string address_;
  std::uint64_t number_;  // rises with the time of arrival
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
  boost::asio::thread_pool urgent{1}, usual, heavy;

  Service(const Dispatcher& d, Hub& h, const ServerOptions& o, Content c);

  using Work = std::function<std::optional<std::string>()>;
  using Done = std::function<void(std::optional<std::string>)>;
  // Does the work on a thread of the lane; `done` gets its text on the io thread.
  void run(Lane lane, Work work, Done done);
  // The same with what the dispatcher replies to the text. What stops the bench is not kept waiting by what
  // comes with it.
  void call(std::string text, std::shared_ptr<CallContext> context, Done done);
  // Room for one more that comes by TCP from this address; strangers give way, the oldest first. False: those
  // who have shown the token fill the house.
  bool make_room(const std::string& address);

 private:
  boost::asio::thread_pool& threads(Lane lane);
};

// A full house is told so, and closed.
void start_http(Service& service, boost::asio::ip::tcp::socket socket, bool full);
void start_unix(Service& service, boost::asio::local::stream_protocol::socket socket, bool full);

}  // namespace ferrobench::server
