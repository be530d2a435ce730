#include "server/net/server.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <future>
#include <iterator>
#include <mutex>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/priority.h"
#include "base/unix_socket.h"
#include "server/net/service.h"

namespace ferrobench::server {

namespace asio = boost::asio;
using asio::ip::tcp;
using local = asio::local::stream_protocol;
using boost::system::error_code;

Session::Session(Service& service, std::string address)
    : service_(service), address_(std::move(address)), number_(service.connections) {
  service_.sessions.insert(this);
}

Session::~Session() {
  service_.sessions.erase(this);
}

namespace {

constexpr std::size_t most_local_stops = 16;    // without a place, beside those who have one
constexpr std::size_t most_views_waiting = 32;  // more would wait for longer than anybody does

// Strangers may never take the descriptors of those who have a place, and of the bench: the files of a run,
// the device, a child that reads.
std::size_t strangers_for(const ServerOptions& options) {
  constexpr std::size_t fewest = 16, most = 512, own = 96;
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) != 0) return fewest;
  const std::size_t kept = 2 * options.max_connections + most_local_stops + own;
  return std::clamp(files.rlim_cur > kept ? files.rlim_cur - kept : 0, fewest, most);
}

void let_oldest_go(const std::vector<Session*>& among) {
  (*std::ranges::min_element(among, {}, &Session::number))->leave();
}

}  // namespace

Service::Service(const Dispatcher& d, Hub& h, const ServerOptions& o, Content c)
    : dispatcher(d),
      hub(h),
      options(o),
      content(std::move(c)),
      tls(make_tls(o)),
      usual((o.worker_threads + 1) / 2),
      heavy(std::max(1u, o.worker_threads / 2)),
      most_strangers_(strangers_for(o)) {}

boost::asio::thread_pool& Service::threads(Lane lane) {
  switch (lane) {
    case Lane::urgent:
      return urgent;
    case Lane::heavy:
      return heavy;
    case Lane::usual:
      break;
  }
  return usual;
}

void Service::run(Lane lane, Work work, Done done) {
  ++calls_waiting;
  if (lane == Lane::heavy) ++views_waiting_;
  asio::post(threads(lane), [this, lane, work = std::move(work), done = std::move(done)]() mutable {
    --calls_waiting;
    if (lane == Lane::heavy) {
      --views_waiting_;
      give_way();
    }
    auto reply = work();
    work = nullptr;
    // `done` holds the session, which may only be let go on the io thread.
    asio::post(io, [reply = std::move(reply), done = std::move(done)]() mutable { done(std::move(reply)); });
  });
}

void Service::at_the_disk(std::function<void()> work, std::function<void()> done) {
  asio::post(disk, [this, work = std::move(work), done = std::move(done)]() mutable {
    work();
    work = nullptr;
    asio::post(io, std::move(done));
  });
}

namespace {

using Text = std::optional<std::string>;

// The replies of two parts of one batch.
Text joined(const Text& first, Text second) {
  if (!first || !second) return first ? first : second;
  return first->substr(0, first->size() - 1) + "," + second->substr(1);
}

}  // namespace

void Service::call(std::string text, std::shared_ptr<CallContext> context, Done done) {
  const auto asked = dispatcher.look(text);
  context->crowded = asked.lane == Lane::heavy && views_waiting_ >= most_views_waiting;
  // A refusal takes no worker's time, and the connection is free again at once.
  if (context->crowded && asked.views)
    return asio::post(io, [reply = dispatcher.handle(text, *context), done = std::move(done)]() mutable {
      done(std::move(reply));
    });
  const auto lane = context->crowded ? Lane::usual : asked.lane;
  const auto part = [this, context = std::move(context),
                     text = std::make_shared<const std::string>(std::move(text))](Part which) {
    return [this, context, text, which] { return dispatcher.handle(*text, *context, which); };
  };
  if (!asked.stop || asked.alone) return run(lane, part(Part::all), std::move(done));
  run(Lane::urgent, part(Part::stops), [this, lane, part, done = std::move(done)](Text first) {
    run(lane, part(Part::rest),
        [first = std::move(first), done](Text rest) { done(joined(first, std::move(rest))); });
  });
}

std::vector<Session*> Service::strangers() const {
  std::vector<Session*> out;
  std::ranges::copy_if(sessions, std::back_inserter(out),
                       [](const Session* s) { return s->stranger() && !s->leaving(); });
  return out;
}

void Service::make_room(const std::string& address) {
  auto there = strangers();
  const bool full = there.size() >= most_strangers_;
  const auto theirs =
      std::ranges::partition(there, [&](const Session* s) { return s->address() != address; });
  const std::vector from_there(theirs.begin(), theirs.end());
  if (from_there.size() >= most_strangers_ / 2) {
    let_oldest_go(from_there);
  } else if (full) {
    let_oldest_go(there);
  }
}

bool Service::let_a_stranger_go() {
  const auto there = strangers();
  if (!there.empty()) let_oldest_go(there);
  return !there.empty();
}

bool Service::has_place() const {
  return static_cast<std::size_t>(std::ranges::count_if(sessions, [](const Session* s) {
           return !s->stranger() && !s->local() && !s->leaving();
         })) < options.max_connections;
}

bool Service::has_local_place() const {
  return static_cast<std::size_t>(std::ranges::count_if(sessions, [](const Session* s) {
           return s->local() && !s->only_stops() && !s->leaving();
         })) < options.max_connections;
}

void Service::make_room_for_a_local_stop() {
  std::vector<Session*> there;
  std::ranges::copy_if(sessions, std::back_inserter(there),
                       [](const Session* s) { return s->local() && s->only_stops() && !s->leaving(); });
  if (there.size() >= most_local_stops) let_oldest_go(there);
}

Refusal full_house() {
  return {503,
          ErrorCode::busy,
          "too many connections are open",
          "close some, or try again later; run.abort and run.status are served all the same",
          {{"Retry-After", "1"}}};
}

namespace {

// Accepts for ever. Running out of file descriptors passes: it tries again a little later.
template <class Protocol, class Start>
class Listener {
 public:
  Listener(Service& service, typename Protocol::acceptor acceptor, Start start)
      : service_(service), acceptor_(std::move(acceptor)), pause_(service.io), start_(start) {}

  void accept() {
    acceptor_.async_accept([this](error_code ec, typename Protocol::socket socket) {
      if (ec == asio::error::operation_aborted || !acceptor_.is_open()) return;
      if (ec == asio::error::no_descriptors && service_.let_a_stranger_go()) return accept();
      if (ec) {
        spdlog::warn("accepting a connection failed: {}", ec.message());
        pause_.expires_after(std::chrono::milliseconds(100));
        return pause_.async_wait([this](error_code stopped) {
          if (!stopped) accept();
        });
      }
      ++service_.connections;
      make_room(socket);
      start_(service_, std::move(socket));
      accept();
    });
  }

  void close() {
    error_code ignored;
    acceptor_.close(ignored);
    pause_.cancel();
  }

 private:
  void make_room(const typename Protocol::socket& socket) {
    if constexpr (std::is_same_v<Protocol, local>) {
      if (!service_.has_local_place()) service_.make_room_for_a_local_stop();
    } else {
      error_code gone;
      service_.make_room(socket.remote_endpoint(gone).address().to_string());
    }
  }

  Service& service_;
  typename Protocol::acceptor acceptor_;
  asio::steady_timer pause_;
  Start start_;
};

tcp::acceptor listen_tcp(asio::io_context& io, const ServerOptions& options) {
  const tcp::endpoint endpoint(asio::ip::make_address(options.address), options.port);
  try {
    return {io, endpoint};
  } catch (const boost::system::system_error& e) {
    throw Error(ErrorCode::busy, "cannot listen on the port",
                Problem{.path = "/port",
                        .message = e.code().message(),
                        .given = options.port,
                        .hint = "another daemon may run already; choose another port, or 0 for a free one"});
  }
}

const ServerOptions& checked(const ServerOptions& options) {
  if (auto problems = options.validate(); !problems.empty())
    throw Error(ErrorCode::invalid_params, "the server's options are not valid", std::move(problems));
  return options;
}

}  // namespace

struct Server::State {
  Service service;
  std::uint16_t port = 0;
  std::optional<Listener<tcp, decltype(&start_http)>> tcp_listener;
  std::optional<Listener<local, decltype(&start_unix)>> unix_listener;
  asio::executor_work_guard<asio::io_context::executor_type> work;
  asio::steady_timer last_call;
  std::once_flag stopped;
  std::thread thread;

  State(const Dispatcher& dispatcher, Hub& hub, const ServerOptions& options, Content content)
      : service(dispatcher, hub, options, std::move(content)),
        work(asio::make_work_guard(service.io)),
        last_call(service.io) {}

  void begin_stop() {
    service.stopping = true;
    if (tcp_listener) tcp_listener->close();
    if (unix_listener) unix_listener->close();
    const auto open = service.sessions;
    for (Session* session : open)
      if (service.sessions.contains(session)) session->stop();
    last_call.expires_after(service.options.stop_timeout);
    last_call.async_wait([this](error_code) { service.io.stop(); });
    work.reset();
    wait_for_sessions();
  }

  void wait_for_sessions() {
    if (service.sessions.empty()) return last_call.cancel(), void();
    auto poll = std::make_shared<asio::steady_timer>(service.io, std::chrono::milliseconds(5));
    poll->async_wait([this, poll](error_code) { wait_for_sessions(); });
  }
};

Server::Server(const Dispatcher& dispatcher, Hub& hub, const ServerOptions& options, Content content)
    : state_(std::make_unique<State>(dispatcher, hub, checked(options), std::move(content))) {
  auto& s = *state_;
  auto acceptor = listen_tcp(s.service.io, options);
  s.port = acceptor.local_endpoint().port();
  auto hosts = options.extra_hosts;
  if (const auto own = acceptor.local_endpoint().address(); !own.is_unspecified())
    hosts.push_back(own.is_v6() ? "[" + own.to_string() + "]" : own.to_string());
  s.service.admission.emplace(options.token, s.port, hosts, s.service.tls != nullptr);
  s.tcp_listener.emplace(s.service, std::move(acceptor), &start_http);
  if (!options.unix_socket.empty())
    s.unix_listener.emplace(
        s.service, local::acceptor(s.service.io, local(), listen_unix(options.unix_socket)), &start_unix);
  s.tcp_listener->accept();
  if (s.unix_listener) s.unix_listener->accept();
  asio::post(s.service.urgent, take_precedence);
  s.thread = std::thread([&s] {
    take_precedence();
    s.service.io.run();
  });
}

Server::~Server() {
  stop();
}

std::uint16_t Server::port() const {
  return state_->port;
}

bool Server::answers(std::chrono::milliseconds within) const {
  auto here = std::make_shared<std::promise<void>>();
  auto answer = here->get_future();
  asio::post(state_->service.io, [here] { here->set_value(); });
  return answer.wait_for(within) == std::future_status::ready;
}

void Server::stop() {
  std::call_once(state_->stopped, [this] {
    auto& s = *state_;
    asio::post(s.service.io, [&s] { s.begin_stop(); });
    s.thread.join();
    for (auto* threads : {&s.service.urgent, &s.service.usual, &s.service.heavy, &s.service.disk}) {
      threads->stop();
      threads->join();
    }
    if (!s.service.options.unix_socket.empty()) unlink(s.service.options.unix_socket.c_str());
  });
}

}  // namespace ferrobench::server
