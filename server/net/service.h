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
#include <vector>

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
  // Has no place of its own: is served only what stops the bench, and gives way to the next such.
  virtual bool only_stops() const { return false; }
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
  boost::asio::thread_pool urgent{1}, usual, heavy, disk{2};

  Service(const Dispatcher& d, Hub& h, const ServerOptions& o, Content c);

  using Work = std::function<std::optional<std::string>()>;
  using Done = std::function<void(std::optional<std::string>)>;
  // Does the work on a thread of the lane; `done` gets its text on the io thread.
  void run(Lane lane, Work work, Done done);
  // The same with what the dispatcher replies to the text. What stops the bench is not kept waiting by what
  // comes with it.
  void call(std::string text, std::shared_ptr<CallContext> context, Done done);
  // Does `work` where a disk that hangs holds up nobody but those who want a file; then `done` on the io
  // thread.
  void at_the_disk(std::function<void()> work, std::function<void()> done);
  // Strangers give way to one more that comes by TCP from this address, the oldest first.
  void make_room(const std::string& address);
  // No descriptor is left for the next: the oldest stranger goes. False: there is none.
  bool let_a_stranger_go();
  // Whether there is a place for one more who has shown the token, or comes by the Unix socket. A full house
  // still serves what stops the bench.
  bool has_place() const;
  bool has_local_place() const;
  void make_room_for_a_local_stop();

 private:
  boost::asio::thread_pool& threads(Lane lane);
  std::vector<Session*> strangers() const;

  std::size_t most_strangers_;
  std::atomic<std::size_t> views_waiting_{0};
};

// What a full house says to whoever asks for more than a stop.
Refusal full_house();

void start_http(Service& service, boost::asio::ip::tcp::socket socket);
void start_unix(Service& service, boost::asio::local::stream_protocol::socket socket);

}  // namespace ferrobench::server
