// What stops the bench waits for nobody: not for viewers, not for what the same client asked before, not for
// strangers who fill the house.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <future>

#include "base/unix_socket.h"
#include "net_bench.h"
#include "server/net/client.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// A client that sends what it likes and waits for nothing.
class Line {
 public:
  explicit Line(const Bench& bench) : fd_(connect_unix(bench.socket_path())) {
    const timeval patience{.tv_sec = 10, .tv_usec = 0};
    setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  }
  ~Line() { close(fd_); }
  void say(const json& request) const { send_all(fd_, request.dump() + "\n"); }
  json hear() {
    while (buffer_.find('\n') == std::string::npos) {
      char c[4096];
      const auto n = recv(fd_, c, sizeof c, 0);
      if (n <= 0) return "nothing came";
      buffer_.append(c, static_cast<std::size_t>(n));
    }
    auto reply = json::parse(buffer_.substr(0, buffer_.find('\n')));
    buffer_.erase(0, buffer_.find('\n') + 1);
    return reply;
  }

 private:
  int fd_;
  std::string buffer_;
};

json call(const std::string& method, int id, const json& params = json::object()) {
  return {{"jsonrpc", "2.0"}, {"method", method}, {"params", params}, {"id", id}};
}
json nap(double seconds, int id) {
  return call("sleep", id, {{"seconds", seconds}});
}

TEST(NetStops, AStopOvertakesWhatTheSameClientAskedBefore) {
  Bench bench;
  Line line(bench);
  const auto begin = Clock::now();
  line.say(nap(1.5, 0));
  for (int i = 1; i <= 40; ++i) line.say(call("count", i));
  line.say(call("stop", 99));
  EXPECT_EQ(line.hear()["id"], 99);
  EXPECT_LT(Clock::now() - begin, 1s);
  EXPECT_EQ(bench.counted, 0);
  for (int i = 0; i <= 40; ++i) EXPECT_EQ(line.hear()["id"], i) << "in their order";
  // What was asked before it may have been a start: in its turn it is carried out once more, without a reply.
  line.say(call("echo", 100, {{"value", 1}}));
  EXPECT_EQ(line.hear()["id"], 100);
  EXPECT_EQ(bench.stopped, 1);
  EXPECT_EQ(bench.stopped_again, 1);
}

TEST(NetStops, ASecondStopRightBehindTheFirstOvertakesToo) {
  Bench bench;
  Line line(bench);
  const auto begin = Clock::now();
  line.say(nap(1.5, 0));
  for (int i = 1; i <= 5; ++i) line.say(call("stop", i));
  for (int i = 1; i <= 5; ++i) EXPECT_EQ(line.hear()["id"], i);
  EXPECT_LT(Clock::now() - begin, 1s);
  EXPECT_EQ(bench.stopped, 5);
  EXPECT_EQ(line.hear()["id"], 0);
}

TEST(NetStops, AStopInABatchDoesNotWaitForTheRest) {
  Bench bench;
  Line line(bench);
  line.say(json::array({nap(1.5, 1), call("stop", 2)}));
  EXPECT_TRUE(eventually([&] { return bench.stopped == 1; }));
  const auto stopped = Clock::now();
  const auto replies = line.hear();
  EXPECT_GT(Clock::now() - stopped, 0.5s) << "the rest takes its time";
  ASSERT_EQ(replies.size(), 2u);
  EXPECT_EQ(replies[0]["id"], 2);
  EXPECT_EQ(replies[1]["id"], 1);

  // The same behind another call.
  line.say(nap(1.5, 3));
  line.say(json::array({call("count", 4), call("stop", 5)}));
  EXPECT_TRUE(eventually([&] { return bench.stopped == 2; }));
  EXPECT_EQ(bench.counted, 0);
  EXPECT_EQ(line.hear()["id"], 3);
  EXPECT_EQ(line.hear().size(), 2u);
  EXPECT_EQ(bench.stopped, 2);
  EXPECT_EQ(bench.stopped_again, 1);

  const Head batch{.body = json::array({nap(1.5, 1), call("stop", 2)}).dump()};
  auto reply = std::async(std::launch::async, [&] { return http(bench, batch); });
  EXPECT_TRUE(eventually([&] { return bench.stopped == 3; }));
  EXPECT_EQ(reply.wait_for(0s), std::future_status::timeout);
  EXPECT_EQ(json::parse(reply.get().body).size(), 2u);
}

TEST(NetStops, ViewersKeepNobodyWaiting) {
  Bench bench;
  std::vector<std::future<Reply>> viewers;
  for (int i = 0; i < 8; ++i)
    viewers.push_back(std::async(std::launch::async, [&] {
      return http(bench, {.body = call("view", 1, {{"seconds", 0.5}}).dump()});
    }));
  ASSERT_TRUE(eventually([&] { return bench.viewing == 2; }));
  for (const auto& method : {"stop", "count"}) {
    const auto begin = Clock::now();
    EXPECT_EQ(http(bench, {.body = call(method, 1).dump()}).status, 200);
    EXPECT_LT(Clock::now() - begin, 400ms) << method;
  }
  EXPECT_LE(bench.most_viewing, 2);  // half of the workers
  for (auto& viewer : viewers) EXPECT_EQ(viewer.get().status, 200);
}

// Viewers who ask and leave, and come again: what they asked for waits for a thread all the same.
TEST(NetStops, MoreViewersThanAnybodyWaitsForAreRefused) {
  Bench bench;
  std::vector<std::future<Reply>> viewers;
  for (int i = 0; i < 50; ++i)
    viewers.push_back(std::async(std::launch::async, [&] {
      return http(bench, {.body = call("view", 1, {{"seconds", 0.3}}).dump()});
    }));
  std::size_t busy = 0;
  for (auto& viewer : viewers) {
    const auto reply = json::parse(viewer.get().body);
    if (!reply.contains("error")) continue;
    EXPECT_EQ(reply["error"]["data"]["name"], "busy");
    EXPECT_NE(reply["error"]["data"]["problems"][0]["hint"], "");
    ++busy;
  }
  EXPECT_GE(busy, 10u);
  EXPECT_LE(busy, 50u - 32);
  EXPECT_EQ(http(bench, {.body = call("view", 1, {{"seconds", 0}}).dump()}).status, 200);
}

// A viewer who is refused leaves the place to others though every worker is taken.
TEST(NetStops, ARefusedViewWaitsForNoWorker) {
  Bench bench;
  std::vector<std::unique_ptr<Line>> lines;
  const auto ask = [&](const json& request) {
    lines.push_back(std::make_unique<Line>(bench));
    lines.back()->say(request);
  };
  for (int i = 0; i < 2; ++i) ask(call("view", i, {{"seconds", 2}}));
  ASSERT_TRUE(eventually([&] { return bench.viewing == 2; }));
  for (int i = 0; i < 32; ++i) ask(call("view", i, {{"seconds", 0}}));
  for (int i = 0; i < 4; ++i) ask(nap(2, i));
  std::this_thread::sleep_for(100ms);
  const auto begin = Clock::now();
  for (const auto& body : {call("view", 7), json::array({call("view", 7), call("view", 8)})}) {
    const auto reply = json::parse(http(bench, {.body = body.dump()}).body);
    EXPECT_EQ((reply.is_array() ? reply[0] : reply)["error"]["data"]["name"], "busy");
  }
  EXPECT_LT(Clock::now() - begin, 1s);
}

TEST(NetStops, LongTextsAreNotLookedThroughForOne) {
  Bench bench;
  const auto all = [&](const json& text) { return bench.rpc.look(text.dump()); };
  EXPECT_EQ(all(call("stop", 1)).lane, Lane::urgent);
  EXPECT_TRUE(all(call("stop", 1)).alone);
  EXPECT_EQ(all(call("count", 1)).lane, Lane::usual);
  EXPECT_EQ(all(call("view", 1)).lane, Lane::heavy);
  EXPECT_EQ(all(json::array({call("count", 1), call("view", 1)})).lane, Lane::heavy);
  EXPECT_FALSE(all(json::array({call("count", 1), call("stop", 1)})).alone);
  EXPECT_FALSE(all(call("echo", 1, {{"method", "stop"}, {"value", call("stop", 2)}})).stop);
  EXPECT_EQ(all(call("stop", 1, {{"reason", std::string(100'000, 'x')}})).lane, Lane::heavy);
  EXPECT_FALSE(bench.rpc.look("[{\"method\": \"stop\"}, nonsense").stop);
}

TEST(NetStops, StrangersGiveWay) {
  Bench bench;
  std::vector<int> strangers;
  for (int i = 0; i < 400; ++i) strangers.push_back(connect_tcp(bench.port()));
  EXPECT_EQ(http(bench, {}).status, 200);
  // Those who were there first have gone, and no more of one address stay than may.
  const auto gone = [&](int fd) {
    char c = 0;
    return recv(fd, &c, 1, MSG_DONTWAIT) == 0;
  };
  EXPECT_TRUE(eventually([&] { return std::ranges::count_if(strangers, gone) >= 400 - 256; }));
  EXPECT_TRUE(gone(strangers.front()));
  EXPECT_FALSE(gone(strangers.back()));
  for (const int fd : strangers) close(fd);
}

TEST(NetStops, WhoHasShownTheTokenStays) {
  ServerOptions options;
  options.max_connections = 4;
  Bench bench(options);
  const Head slow{.body = nap(1, 1).dump()};
  auto guest = std::async(std::launch::async, [&] { return http(bench, slow).status; });
  std::this_thread::sleep_for(200ms);
  std::vector<int> strangers;
  for (int i = 0; i < 30; ++i) strangers.push_back(connect_tcp(bench.port()));
  EXPECT_EQ(http(bench, {.body = call("stop", 1).dump()}).status, 200);
  EXPECT_EQ(guest.get(), 200);
  for (const int fd : strangers) close(fd);
}

TEST(NetStops, AFullHouseIsStoppedAllTheSame) {
  ServerOptions options;
  options.max_connections = 2;
  Bench bench(options);
  std::vector<std::future<int>> guests;
  for (int i = 0; i < 2; ++i)
    guests.push_back(
        std::async(std::launch::async, [&] { return http(bench, {.body = nap(1.5, 1).dump()}).status; }));
  std::this_thread::sleep_for(300ms);
  EXPECT_EQ(http(bench, {.body = call("stop", 1).dump()}).status, 200);
  EXPECT_EQ(http(bench, {.method = "GET", .target = "/", .body = ""}).status, 200)
      << "the page has the button";
  const auto refused = http(bench, {.body = call("count", 1).dump()});
  EXPECT_EQ(refused.status, 503);
  EXPECT_NE(refused.body.find("run.abort"), std::string::npos);
  EXPECT_EQ(http(bench, {.body = json::array({call("stop", 1), call("count", 2)}).dump()}).status, 503);
  EXPECT_EQ(http(bench, {.method = "GET", .target = "/recordings/loop.h5", .body = ""}).status, 503);
  EXPECT_EQ(http(bench, {.method = "GET", .target = "/metrics", .body = ""}).status, 503);
  EXPECT_EQ(bench.stopped, 1);
  EXPECT_EQ(bench.counted, 0);
  for (auto& guest : guests) EXPECT_EQ(guest.get(), 200);
}

TEST(NetStops, AFullUnixSocketIsStoppedAllTheSame) {
  ServerOptions options;
  options.max_connections = 2;
  Bench bench(options);
  Line first(bench), second(bench);
  first.say(call("count", 1));
  second.say(call("count", 2));
  EXPECT_EQ(first.hear()["id"], 1);
  EXPECT_EQ(second.hear()["id"], 2);
  // However many wait there, the next one is heard.
  std::vector<std::unique_ptr<Line>> idle;
  for (int i = 0; i < 50; ++i) idle.push_back(std::make_unique<Line>(bench));
  Line other(bench);
  other.say(call("stop", 3));
  EXPECT_EQ(other.hear()["id"], 3);
  other.say(call("count", 4));
  EXPECT_EQ(other.hear()["error"]["data"]["name"], "busy");
  EXPECT_EQ(bench.stopped, 1);
  EXPECT_EQ(bench.counted, 2);
  first.say(call("count", 5));
  EXPECT_EQ(first.hear()["id"], 5);
}

TEST(NetStops, ADiskThatHangsHoldsUpOnlyWhoWantsAFile) {
  Bench bench({}, [](Bench&, Content& content) {
    content.recording = [find = content.recording](const std::string& name) {
      std::this_thread::sleep_for(1s);
      return find(name);
    };
  });
  std::vector<std::future<Reply>> downloads;
  for (int i = 0; i < 3; ++i)
    downloads.push_back(std::async(std::launch::async, [&] {
      return http(bench, {.method = "GET", .target = "/recordings/loop.h5", .body = ""});
    }));
  std::this_thread::sleep_for(100ms);
  const auto begin = Clock::now();
  EXPECT_EQ(http(bench, {.body = call("stop", 1).dump()}).status, 200);
  EXPECT_EQ(http(bench, {.body = call("count", 1).dump()}).status, 200);
  EXPECT_LT(Clock::now() - begin, 500ms);
  for (auto& download : downloads) EXPECT_EQ(download.get().body, bench.recording);
}

// Strangers from a process of their own, as this one has few descriptors.
class Crowd {
 public:
  Crowd(const Bench& bench, int count) {
    child_ = fork();
    if (child_ != 0) return;
    rlimit files{};
    getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = files.rlim_max;
    setrlimit(RLIMIT_NOFILE, &files);
    for (int i = 0; i < count; ++i) connect_tcp(bench.port());
    for (;;) pause();
  }
  ~Crowd() {
    kill(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
  }
  Crowd(const Crowd&) = delete;
  Crowd& operator=(const Crowd&) = delete;

 private:
  pid_t child_;
};

TEST(NetStops, StrangersNeverTakeAllDescriptors) {
  rlimit usual{};
  getrlimit(RLIMIT_NOFILE, &usual);
  for (const rlim_t few : {256, 100}) {  // with 100 there are fewer than the places need
    SCOPED_TRACE(few);
    rlimit files = usual;
    files.rlim_cur = few;
    ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &files), 0);
    {
      Bench bench;
      const Crowd crowd(bench, 400);
      std::this_thread::sleep_for(500ms);
      for (int i = 0; i < 20; ++i) {
        const auto begin = Clock::now();
        EXPECT_EQ(http(bench, {.body = call("stop", 1).dump()}).status, 200);
        EXPECT_LT(Clock::now() - begin, 500ms);
      }
      const int file = open(bench.folder.c_str(), O_RDONLY | O_CLOEXEC);
      EXPECT_GE(file, 0) << "and some are left for files";
      close(file);
    }
    setrlimit(RLIMIT_NOFILE, &usual);
  }
}

}  // namespace
}  // namespace ferrobench::server
