// ferrobench_load PROGRAM [--seconds 60] [--subscribers 50] [--rate 125000] [--data FOLDER]
//
// A daemon of its own (PROGRAM serve) runs a program in real time on the virtual device, four channels at
// RATE rows/s, while so many WebSocket clients subscribe to samples and run, of which one never reads.
// Meanwhile, and before that on an idle daemon, one client calls methods and takes the time.
//
// It prints what each subscriber got and missed, the memory of the daemon, whether acquisition ever waited,
// and the times of the calls, beside the time that two threads take to wake each other on this machine as
// busy as it is. Exit code 1 if a promise is broken.
#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <thread>

#include "server/net/client.h"

namespace ferrobench {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using nlohmann::json;

struct Options {
  std::string program{};
  double seconds = 60, rate = 125e3;
  std::size_t subscribers = 50;
  fs::path data = fs::temp_directory_path() / ("ferrobench-load-" + std::to_string(getpid()));
};

class Daemon {
 public:
  explicit Daemon(const Options& options) : folder_(options.data) {
    fs::create_directories(folder_);
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
    const auto data = folder_.string(), secret = (folder_ / "token").string();
    std::array arguments{options.program.c_str(),
                         "serve",
                         "--port",
                         "0",
                         "--data",
                         data.c_str(),
                         "--token-file",
                         secret.c_str(),
                         static_cast<const char*>(nullptr)};
    const int failed = posix_spawn(&pid_, options.program.c_str(), &actions, nullptr,
                                   const_cast<char**>(arguments.data()), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    if (failed != 0) throw std::runtime_error(options.program + " cannot be started");
    std::string said;
    for (std::array<char, 256> part{}; said.find("Ctrl-C") == std::string::npos;) {
      const auto count = read(ends[0], part.data(), part.size());
      if (count <= 0) throw std::runtime_error("the daemon did not start: " + said);
      said.append(part.data(), static_cast<std::size_t>(count));
    }
    const auto port = said.find("127.0.0.1:") + std::strlen("127.0.0.1:");
    port_ = static_cast<std::uint16_t>(std::stoi(said.substr(port, 5)));
    std::ifstream(secret) >> token_;
  }
  ~Daemon() {
    kill(pid_, SIGTERM);
    waitpid(pid_, nullptr, 0);
  }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  server::Client client() const { return server::Client::connect((folder_ / "daemon.sock").string()); }
  std::uint16_t port() const { return port_; }
  const std::string& token() const { return token_; }
  double resident_mib() const {
    std::ifstream file("/proc/" + std::to_string(pid_) + "/statm");
    double size = 0, resident = 0;
    file >> size >> resident;
    return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
  }

 private:
  fs::path folder_;
  pid_t pid_ = 0;
  std::uint16_t port_ = 0;
  std::string token_;
};

int connect_to(const Daemon& daemon) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in where{.sin_family = AF_INET, .sin_port = htons(daemon.port()), .sin_addr = {}, .sin_zero = {}};
  where.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(fd, reinterpret_cast<sockaddr*>(&where), sizeof where) != 0)
    throw std::runtime_error("no connection");
  return fd;
}

void send_all(int fd, const std::string& text) {
  if (send(fd, text.data(), text.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(text.size()))
    throw std::runtime_error("nothing can be sent");
}

// A WebSocket client that only counts.
class Subscriber {
 public:
  explicit Subscriber(const Daemon& daemon) : fd_(connect_to(daemon)) {
    send_all(fd_, "GET /rpc HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(daemon.port()) +
                      "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nAuthorization: Bearer " +
                      daemon.token() + "\r\n\r\n");
    while (buffer_.find("\r\n\r\n") == std::string::npos)
      if (!receive()) throw std::runtime_error("no WebSocket: " + buffer_);
    if (!buffer_.starts_with("HTTP/1.1 101")) throw std::runtime_error("no WebSocket: " + buffer_);
    buffer_.erase(0, buffer_.find("\r\n\r\n") + 4);
    for (const auto* topic : {"run", "samples"})
      say(1, json{{"jsonrpc", "2.0"}, {"method", "subscribe"}, {"params", {{"topic", topic}}}, {"id", topic}}
                 .dump());
  }
  ~Subscriber() { close(fd_); }
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;

  int fd() const { return fd_; }
  bool open() const { return open_; }

  // What has come. False once the daemon has closed.
  bool take() {
    open_ = open_ && receive();
    std::size_t at = 0;
    while (buffer_.size() - at >= 2) {
      const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(buffer_[at + i]); };
      std::size_t head = 2;
      std::uint64_t length = byte(1);
      if (length >= 126) {
        const std::size_t more = length == 126 ? 2 : 8;
        if (buffer_.size() - at < 2 + more) break;
        length = 0;
        for (std::size_t i = 0; i < more; ++i) length = length << 8 | byte(2 + i);
        head += more;
      }
      if (buffer_.size() - at < head + length) break;
      const int kind = byte(0) & 15;
      const auto text = buffer_.substr(at + head, length);
      if (kind == 1) hear(text);
      if (kind == 8) closed = text.size() > 2 ? text.substr(2) : "closed";
      if (kind == 9) say(10, text);
      at += head + length;
    }
    buffer_.erase(0, at);
    return open_;
  }

  std::map<std::string, std::uint64_t, std::less<>> got, lost;
  std::uint64_t bytes = 0;
  std::uint64_t mark = 0;  // of the samples that came: the same for all who missed nothing
  std::string closed;      // what the daemon said

 private:
  bool receive() {
    std::array<char, 1u << 16> part;
    const auto count = recv(fd_, part.data(), part.size(), 0);
    if (count > 0) buffer_.append(part.data(), static_cast<std::size_t>(count));
    if (count > 0) bytes += static_cast<std::uint64_t>(count);
    return count > 0 || (count < 0 && errno == EINTR);
  }

  // Masked with zeros.
  void say(int kind, const std::string& text) {
    std::string frame{static_cast<char>(0x80 | kind), static_cast<char>(0x80 | 126),
                      static_cast<char>(text.size() >> 8), static_cast<char>(text.size() & 255)};
    if (text.size() < 126) frame = {static_cast<char>(0x80 | kind), static_cast<char>(0x80 | text.size())};
    send_all(fd_, frame + std::string(4, '\0') + text);
  }

  // Keys are in alphabetical order: the topic is near the beginning.
  void hear(const std::string& text) {
    constexpr std::string_view before = "\"method\":\"";
    const auto at = text.substr(0, 64).find(before);
    if (at == std::string::npos) return;  // a reply
    const auto begin = at + before.size();
    const auto topic = text.substr(begin, text.find('"', begin) - begin);
    if (topic == "gap") {
      const auto gap = json::parse(text).at("params");
      lost[gap.at("topic").get<std::string>()] += gap.at("lost").get<std::uint64_t>();
      return;
    }
    ++got[topic];
    if (topic == "samples") mark = mark * 31 + std::hash<std::string>()(text);
  }

  int fd_;
  std::string buffer_;
  bool open_ = true;
};

// Times of calls in ms.
struct Times {
  std::vector<double> all{};
  double share(double part) {
    if (all.empty()) return NAN;
    std::ranges::sort(all);
    return all[std::min(all.size() - 1, static_cast<std::size_t>(part * static_cast<double>(all.size())))];
  }
};

// One call after the other on a connection that stays, by HTTP.
class HttpProbe {
 public:
  explicit HttpProbe(const Daemon& daemon) : daemon_(daemon), fd_(connect_to(daemon)) {}
  ~HttpProbe() { close(fd_); }
  HttpProbe(const HttpProbe&) = delete;
  HttpProbe& operator=(const HttpProbe&) = delete;
  void call(const char* method) {
    const auto body = json{{"jsonrpc", "2.0"}, {"method", method}, {"id", 1}}.dump();
    send_all(fd_, "POST /rpc HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(daemon_.port()) +
                      "\r\nAuthorization: Bearer " + daemon_.token() +
                      "\r\nContent-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) +
                      "\r\n\r\n" + body);
    std::string reply;
    for (std::array<char, 1u << 16> part; !whole(reply);) {
      const auto count = recv(fd_, part.data(), part.size(), 0);
      if (count <= 0) throw std::runtime_error("the daemon closed the connection");
      reply.append(part.data(), static_cast<std::size_t>(count));
    }
    if (reply.find("\"result\"") == std::string::npos) throw std::runtime_error(reply);
  }

 private:
  static bool whole(const std::string& reply) {
    constexpr std::string_view name = "Content-Length: ";
    const auto at = reply.find(name), end = reply.find("\r\n\r\n");
    return at < end && end != std::string::npos &&
           reply.size() - end - 4 >= static_cast<std::size_t>(std::stoi(reply.substr(at + name.size(), 12)));
  }
  const Daemon& daemon_;
  int fd_;
};

// What the machine itself takes to wake another thread and be woken by it.
class Echo {
 public:
  Echo() {
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends_.data()) != 0) throw std::runtime_error("no sockets");
    thread_ = std::jthread([other = ends_[1]] {
      for (char byte = 0; recv(other, &byte, 1, 0) == 1;) send(other, &byte, 1, MSG_NOSIGNAL);
    });
  }
  ~Echo() {
    shutdown(ends_[0], SHUT_RDWR);
    thread_.join();
    for (const int end : ends_) close(end);
  }
  Echo(const Echo&) = delete;
  Echo& operator=(const Echo&) = delete;
  void call() const {
    char byte = 0;
    if (send(ends_[0], &byte, 1, MSG_NOSIGNAL) != 1 || recv(ends_[0], &byte, 1, 0) != 1)
      throw std::runtime_error("no echo");
  }

 private:
  std::array<int, 2> ends_{};
  std::jthread thread_;
};

struct Latency {
  Times unix_socket{}, http{}, machine{};
};

// 70 calls a second by either way, until it is over.
Latency probe(const Daemon& daemon, const std::function<bool()>& over) {
  constexpr std::array methods{"run.status", "system.info", "lease.status", "limits.get"};
  Latency out;
  auto client = daemon.client();
  HttpProbe http(daemon);
  const Echo echo;
  const auto timed = [](Times& times, const auto& act) {
    const auto begin = Clock::now();
    act();
    times.all.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
  };
  for (std::size_t i = 0; !over(); ++i) {
    const auto* method = methods[i / 2 % methods.size()];
    timed(out.unix_socket, [&] { client.call(method); });
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    timed(out.http, [&] { http.call(method); });
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    timed(out.machine, [&] { echo.call(); });
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return out;
}

json protocol(const Options& options) {
  return {{"format", "ferrobench-protocol"},
          {"version", 1},
          {"name", "load"},
          {"unit", "kV/mm"},
          {"start", 0},
          {"sample_rate_Hz", options.rate},
          {"segments",
           {{{"kind", "triangle"},
             {"low", 0},
             {"high", 1},
             {"rate", 2},
             {"cycles", static_cast<int>(options.seconds) + 60},
             {"first", "up"}}}}};
}

int broken = 0;

bool promise(bool kept, const char* what) {
  std::printf("%s  %s\n", kept ? "kept  " : "BROKEN", what);
  broken += kept ? 0 : 1;
  return kept;
}

void print(const char* when, Latency& latency, double goal) {
  for (auto [way, times] : {std::pair{"unix socket", &latency.unix_socket},
                            {"http", &latency.http},
                            {"the machine's own echo", &latency.machine}})
    std::printf("%s, %s: %zu calls, p50 %.3f ms, p99 %.3f ms, max %.1f ms\n", when, way, times->all.size(),
                times->share(0.5), times->share(0.99), times->share(1));
  const auto what =
      "p99 of calls, " + std::string(when) + ", below " + json(goal).dump() + " ms above the machine's own";
  goal += latency.machine.share(0.99);
  promise(latency.unix_socket.share(0.99) < goal && latency.http.share(0.99) < goal, what.c_str());
}

// Reads for all but the one that never does.
void listen(std::deque<Subscriber>& subscribers, const std::atomic<bool>& over) {
  std::vector<pollfd> items;
  for (std::size_t i = 1; i < subscribers.size(); ++i)
    items.push_back({.fd = subscribers[i].fd(), .events = POLLIN, .revents = 0});
  for (bool quiet = false; !over || !quiet;) {
    quiet = poll(items.data(), items.size(), 200) == 0;
    for (std::size_t i = 0; i < items.size(); ++i)
      if (items[i].revents != 0 && !subscribers[i + 1].take()) items[i].fd = -1;
  }
}

// How far the rows are behind the clock, in s.
double behind(server::Client& client, Clock::time_point begin, double rate) {
  const auto status = client.call("run.status");
  return std::chrono::duration<double>(Clock::now() - begin).count() - status.at("rows").get<double>() / rate;
}

void load(const Options& options) {
  using Seconds = std::chrono::duration<double>;
  const Daemon daemon(options);
  auto client = daemon.client();
  const auto until = [](double seconds) {
    return [end = Clock::now() + std::chrono::duration_cast<Clock::duration>(Seconds(seconds))] {
      return Clock::now() >= end;
    };
  };
  auto idle = probe(daemon, until(std::min(20.0, options.seconds / 3)));

  client.call("subscribe", {{"topic", "events"}});
  std::deque<Subscriber> subscribers;
  for (std::size_t i = 0; i < options.subscribers; ++i) subscribers.emplace_back(daemon);
  std::atomic<bool> over = false;
  std::jthread listener([&] { listen(subscribers, over); });
  const auto begin = Clock::now();
  client.call("run.start", {{"protocol", protocol(options)}});
  std::this_thread::sleep_for(Seconds(5));  // to what it needs while it runs
  const double memory_begin = daemon.resident_mib(), behind_begin = behind(client, begin, options.rate);
  double behind_most = behind_begin;
  std::jthread watch([&](const std::stop_token& stop) {
    for (auto other = daemon.client(); !stop.stop_requested(); std::this_thread::sleep_for(Seconds(0.5)))
      behind_most = std::max(behind_most, behind(other, begin, options.rate));
  });
  auto busy = probe(daemon, until(options.seconds));
  watch.request_stop();
  watch.join();
  const double memory_end = daemon.resident_mib(), behind_end = behind(client, begin, options.rate);
  client.call("run.abort", {{"reason", "long enough"}});
  json status;
  do {
    std::this_thread::sleep_for(Seconds(0.2));
    status = client.call("run.status");
  } while (status.at("ended") == "");
  const double memory_after = daemon.resident_mib();
  std::this_thread::sleep_for(Seconds(1));
  over = true;
  listener.join();

  auto& deaf = subscribers.front();
  while (deaf.take()) {
    pollfd more{.fd = deaf.fd(), .events = POLLIN, .revents = 0};
    if (poll(&more, 1, 1000) == 0) break;
  }

  std::uint64_t most = 0;
  for (const auto& s : subscribers)
    most = std::max(most, s.got.contains("samples") ? s.got.at("samples") : 0);
  std::printf("\n%-4s %10s %10s %10s %10s %10s\n", "", "samples", "missed", "run", "missed", "MB");
  bool all_there = true;
  for (std::size_t i = 0; i < subscribers.size(); ++i) {
    auto& s = subscribers[i];
    std::printf("%-4zu %10lu %10lu %10lu %10lu %10.1f%s%s\n", i, s.got["samples"], s.lost["samples"],
                s.got["run"], s.lost["run"], static_cast<double>(s.bytes) / 1e6,
                s.open() ? "" : "  closed by the daemon: ", s.closed.c_str());
    if (i == 0) continue;
    all_there = all_there && s.open() && s.got["samples"] == most && s.mark == subscribers[1].mark &&
                s.lost.at("samples") == 0 && s.lost["run"] == 0;
  }
  std::printf("(0 never read until the run was over)\n\n");

  std::map<std::string, int> events;
  while (const auto next = client.next(std::chrono::milliseconds(100)))
    if (next->topic == "events") ++events[next->params.at("kind").get<std::string>()];
  std::printf("%.0f rows, %s, %s; %s\n", status.at("rows").get<double>(),
              status.at("state").get<std::string>().c_str(), status.at("reason").get<std::string>().c_str(),
              json(events).dump().c_str());
  std::printf("at most %.0f %% of the queue between device and disk was in use\n",
              100 * status.at("queue_used").get<double>());
  std::printf("rows behind the clock: %.2f s at the beginning, %.2f s at the end, at most %.2f s\n",
              behind_begin, behind_end, behind_most);
  std::printf(
      "memory of the daemon: %.1f MiB at the beginning, %.1f MiB at the end, %.1f MiB once the file was "
      "made\n",
      memory_begin, memory_end, memory_after);

  promise(all_there, "every subscriber that reads got everything");
  promise(deaf.got["samples"] + deaf.lost["samples"] >= most || !deaf.open(),
          "the one that never reads is told what it missed, or closed");
  promise(memory_end - memory_begin < 16, "the memory grows by less than 16 MiB");
  promise(status.at("reason").get<std::string>().ends_with("long enough") && !events.contains("gap") &&
              !events.contains("overrun") && !events.contains("underrun"),
          "no sample was lost");
  promise(status.at("queue_used").get<double>() < 0.5, "acquisition never waited for the writer");
  print("idle", idle, 0.5);
  print("meanwhile", busy, 2);
}

}  // namespace
}  // namespace ferrobench

int main(int argc, char** argv) {
  ferrobench::Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string_view name = argv[i];
    const auto value = [&] { return i + 1 < argc ? argv[++i] : ""; };
    if (name == "--seconds")
      options.seconds = std::atof(value());
    else if (name == "--rate")
      options.rate = std::atof(value());
    else if (name == "--subscribers")
      options.subscribers = static_cast<std::size_t>(std::atoi(value()));
    else if (name == "--data")
      options.data = value();
    else
      options.program = name;
  }
  if (options.program.empty() || !(options.seconds >= 1) || options.subscribers < 2) {
    std::fprintf(stderr,
                 "ferrobench_load PROGRAM [--seconds N] [--subscribers N] [--rate HZ] [--data FOLDER]\n");
    return 2;
  }
  try {
    ferrobench::load(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  std::filesystem::remove_all(options.data);
  return ferrobench::broken == 0 ? 0 : 1;
}
