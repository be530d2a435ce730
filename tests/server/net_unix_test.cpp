// The Unix socket and the blocking client on it.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "base/unix_socket.h"
#include "net_bench.h"
#include "server/net/client.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(NetUnix, SocketIsForItsOwnerOnly) {
  Bench bench;
  struct stat info {};
  ASSERT_EQ(stat(bench.socket_path().c_str(), &info), 0);
  EXPECT_TRUE(S_ISSOCK(info.st_mode));
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  bench.server->stop();
  EXPECT_FALSE(std::filesystem::exists(bench.socket_path()));
}

TEST(NetUnix, ClientCallsAndThrowsWhatTheDaemonThrew) {
  Bench bench;
  auto client = Client::connect(bench.socket_path());
  EXPECT_EQ(client.call("echo", {{"value", {1, "two\nlines"}}}), (json{1, "two\nlines"}));
  EXPECT_TRUE(client.call("who")[0].get<std::string>().starts_with("unix "));
  try {
    client.call("sleep", {{"seconds", 99}});
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::invalid_params);
    ASSERT_EQ(e.problems().size(), 1u);
    EXPECT_EQ(e.problems()[0].path, "/seconds");
    EXPECT_EQ(e.problems()[0].unit, "s");
    EXPECT_EQ(e.problems()[0].allowed, (json{{"from", 0.0}, {"to", 5.0}}));
  }
  try {
    client.call("ecko");
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::not_found);
    EXPECT_EQ(e.problems().at(0).hint, "did you mean \"echo\"?");
  }
  EXPECT_THROW(client.call("sleep", {{"seconds", 2}}, milliseconds(50)), Error);
  EXPECT_EQ(client.call("echo", {{"value", 5}}), 5)
      << "the late reply of the call before is not taken for this one's";
}

// A socket's address takes 107 bytes, a folder's name as many as it likes.
TEST(NetUnix, APathMayBeLong) {
  const auto name = (std::filesystem::temp_directory_path() / "ferrobench-long-XXXXXX").string();
  std::vector<char> made(name.c_str(), name.c_str() + name.size() + 1);
  const std::filesystem::path root = mkdtemp(made.data());
  const auto folder = root / std::string(120, 'd');
  const auto path = (folder / "daemon.sock").string();
  EXPECT_FALSE(Client::try_connect(path).has_value());
  const int listening = listen_unix(path);
  ASSERT_GE(listening, 0);
  EXPECT_TRUE(std::filesystem::is_socket(path));
  EXPECT_TRUE(Client::try_connect(path).has_value());
  EXPECT_THROW(listen_unix(path), Error) << "it is taken";
  close(listening);
  EXPECT_THROW(listen_unix((folder / std::string(120, 's')).string()), Error) << "its name is too long";
  std::filesystem::remove_all(root);
}

// A thread may be another user than its process, if that is root's.
TEST(NetUnix, ClientDoesNotTalkToAnotherUsersProgram) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can play another user";
  const auto path =
      (std::filesystem::temp_directory_path() / ("foreign-" + std::to_string(getpid()))).string();
  int listening = -1;
  std::thread([&] {
    syscall(SYS_setresuid, -1, 65534, -1);
    listening = listen_unix(path);
  }).join();
  ASSERT_GE(listening, 0);
  try {
    Client::try_connect(path);
    ADD_FAILURE() << "it trusts anybody";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::unauthorized);
    EXPECT_NE(error.problems().at(0).message.find("65534"), std::string::npos);
  }
  close(listening);
  unlink(path.c_str());
}

TEST(NetUnix, ClientSaysThatNoDaemonRuns) {
  const auto nowhere = (std::filesystem::temp_directory_path() / "no-such-socket").string();
  EXPECT_FALSE(Client::try_connect(nowhere).has_value());
  try {
    Client::connect(nowhere);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::device_unavailable);
    EXPECT_NE(e.problems().at(0).hint.find("serve"), std::string::npos);
  }
}

TEST(NetUnix, NotificationsComeBetweenReplies) {
  Bench bench;
  auto client = Client::connect(bench.socket_path());
  client.call("subscribe", {{"topic", "run"}});
  bench.hub.publish("run", {{"state", "arming"}});
  EXPECT_EQ(client.call("echo", {{"value", 1}}), 1);
  bench.hub.publish("run", {{"state", "running"}});
  EXPECT_EQ(client.next(seconds(10)).value().params["state"], "arming");
  const auto second = client.next(seconds(10)).value();
  EXPECT_EQ(second.topic, "run");
  EXPECT_EQ(second.params["state"], "running");
  EXPECT_FALSE(client.next(milliseconds(20)).has_value());
  { const Client gone = std::move(client); }
  EXPECT_TRUE(eventually([&] { return bench.gone == 1; }));
  EXPECT_FALSE(bench.hub.wanted("run"));
}

TEST(NetUnix, OneLineOneRequestEvenAfterTheLastByte) {
  Bench bench;
  const int fd = connect_unix(bench.socket_path());
  const std::string lines =
      "\n{\"jsonrpc\":\"2.0\",\"method\":\"count\",\"id\":1}\r\n  \nnonsense\n"
      "[{\"jsonrpc\":\"2.0\",\"method\":\"count\",\"id\":2},{\"jsonrpc\":\"2.0\",\"method\":\"count\"}]\n";
  ASSERT_EQ(send(fd, lines.data(), lines.size(), MSG_NOSIGNAL), static_cast<ssize_t>(lines.size()));
  shutdown(fd, SHUT_WR);
  std::istringstream replies(read_all(fd));
  close(fd);
  std::vector<json> got;
  for (std::string line; std::getline(replies, line);) got.push_back(json::parse(line));
  ASSERT_EQ(got.size(), 3u);
  EXPECT_EQ(got[0]["result"], 1);
  EXPECT_EQ(got[1]["error"]["code"], -32700);
  EXPECT_EQ(got[2][0]["result"], 2);
  EXPECT_EQ(bench.counted, 3);
}

TEST(NetUnix, EndlessLineIsRefused) {
  ServerOptions options;
  options.max_body_bytes = 1000;
  Bench bench(options);
  const int fd = connect_unix(bench.socket_path());
  const std::string line(1500, 'x');
  send(fd, line.data(), line.size(), MSG_NOSIGNAL);
  const auto reply = json::parse(read_all(fd));
  close(fd);
  EXPECT_EQ(reply["error"]["code"], -32700);
  EXPECT_EQ(reply["error"]["data"]["hint"], "at most 1000 bytes");
}

TEST(NetUnix, SocketOfACrashedDaemonIsReplacedAndOfALivingOneNot) {
  const auto folder = std::filesystem::temp_directory_path() / ("unix-" + std::to_string(getpid()));
  const auto path = (folder / "rpc.sock").string();
  const int crashed = listen_unix(path);
  EXPECT_THROW(listen_unix(path), Error);
  close(crashed);
  const int fresh = listen_unix(path);
  EXPECT_GE(connect_unix(path), 0);
  close(fresh);
  std::ofstream(folder / "file") << "precious";
  EXPECT_THROW(listen_unix((folder / "file").string()), Error);
  EXPECT_TRUE(std::filesystem::exists(folder / "file"));
  EXPECT_THROW(listen_unix(std::string(200, 'x')), Error);
  std::filesystem::remove_all(folder);
}

TEST(NetUnix, ClientsInParallel) {
  ServerOptions options;
  options.outbox.lost_before_close = 1u << 30;  // nobody is too slow here, whatever else the machine does
  Bench bench(options);
  std::vector<std::thread> threads;
  std::atomic<bool> going{true};
  threads.emplace_back([&] {
    for (int i = 0; going; ++i) bench.hub.publish("samples", {{"i", i}, {"pad", std::string(500, 'x')}});
  });
  for (int t = 0; t < 6; ++t)
    threads.emplace_back([&, t] {
      for (int round = 0; round < 5; ++round) {
        auto client = Client::connect(bench.socket_path());
        if (t % 2 == 0) client.call("subscribe", {{"topic", "samples"}});
        for (int i = 0; i < 20; ++i) EXPECT_EQ(client.call("echo", {{"value", {t, i}}}), (json{t, i}));
        if (t % 2 == 0) {
          EXPECT_TRUE(client.next(seconds(10)).has_value());
        }
        EXPECT_EQ(http(bench, {}).status, 200);
      }
    });
  for (std::size_t i = 1; i < threads.size(); ++i) threads[i].join();
  going = false;
  threads[0].join();
  EXPECT_EQ(bench.counted, 30);
  EXPECT_TRUE(eventually([&] { return bench.gone == 30; }));
}

TEST(NetUnix, ClientThatNeverReadsIsGivenUpAndDelaysNobody) {
  ServerOptions options;
  options.outbox = {.messages = 10, .bytes = 1u << 20, .lost_before_close = 100};
  Bench bench(options);
  const int fd = connect_unix(bench.socket_path());
  const std::string line = R"({"jsonrpc":"2.0","method":"subscribe","params":{"topic":"samples"},"id":1})"
                           "\n";
  send(fd, line.data(), line.size(), MSG_NOSIGNAL);
  ASSERT_TRUE(eventually([&] { return bench.hub.wanted("samples"); }));
  const auto start = std::chrono::steady_clock::now();
  int published = 0;
  for (; published < 5000 && bench.hub.wanted("samples"); ++published)
    bench.hub.publish("samples", std::string(50'000, 'x'));
  EXPECT_LT(published, 5000);
  EXPECT_LT(std::chrono::steady_clock::now() - start, seconds(20));
  EXPECT_TRUE(eventually([&] { return bench.gone == 1; }));
  close(fd);
}

TEST(NetUnix, StopEndsOpenConnections) {
  Bench bench;
  auto client = Client::connect(bench.socket_path());
  client.call("subscribe", {{"topic", "run"}});
  const auto start = std::chrono::steady_clock::now();
  bench.server->stop();
  EXPECT_LT(std::chrono::steady_clock::now() - start, seconds(2));
  EXPECT_THROW(client.call("count"), Error);
}

}  // namespace
}  // namespace ferrobench::server
