// What systemd hears from the daemon, through a socket of the test's own.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>
#include <future>

#include "engine_bench.h"
#include "net_bench.h"
#include "server/cli/cli.h"
#include "server/net/client.h"

namespace ferrobench::server {
namespace {

class Systemd : public testing::Test {
 protected:
  Systemd() : fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    const auto path = (folder.path / "notify").string();
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path.data(), path.size());
    EXPECT_EQ(bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    const timeval patience{.tv_sec = 20, .tv_usec = 0};
    setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
    setenv("WATCHDOG_USEC", "400000", 1);
    setenv("WATCHDOG_PID", std::to_string(getpid()).c_str(), 1);
  }
  ~Systemd() override {
    for (const auto* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) unsetenv(name);
    close(fd_);
  }
  std::string hear() const {
    std::array<char, 256> text{};
    const ssize_t n = recv(fd_, text.data(), text.size(), 0);
    return n < 0 ? "nothing" : std::string(text.data(), static_cast<std::size_t>(n));
  }

  Folder folder;

 private:
  int fd_;
};

TEST_F(Systemd, HearsThatTheDaemonIsReadyLivesAndStops) {
  const auto data = folder.path.string(), token = (folder.path / "token").string();
  auto served = std::async(std::launch::async, [&] {
    const std::array<const char*, 8> words{"ferrobench", "--data", data.c_str(),   "serve",
                                           "--port",     "0",      "--token-file", token.c_str()};
    return cli::run_program(static_cast<int>(words.size()), words.data());
  });
  EXPECT_EQ(hear(), "READY=1");
  EXPECT_EQ(Client::connect((folder.path / "daemon.sock").string()).call("lease.status")["holder"], "")
      << "ready, but nobody listens";
  for (int i = 0; i < 3; ++i) EXPECT_EQ(hear(), "WATCHDOG=1");
  std::raise(SIGTERM);
  std::string last;
  while ((last = hear()) == "WATCHDOG=1") {
  }
  EXPECT_EQ(last, "STOPPING=1");
  EXPECT_EQ(served.get(), cli::exit_ok);
}

// The thread of the network hangs in a callback: the door does not answer, and the watchdog is not told
// otherwise.
TEST(NetServer, SaysWhetherItsThreadComesRound) {
  std::promise<void> hang, go_on;
  auto hangs = hang.get_future();
  auto goes_on = go_on.get_future();
  Bench bench({}, [&](Bench&, Content& content) {
    content.asset = [&](std::string_view) -> std::optional<Asset> {
      hang.set_value();
      goes_on.wait();
      return std::nullopt;
    };
  });
  EXPECT_TRUE(bench.server->answers(std::chrono::seconds(20)));
  const auto bearer = "Authorization: Bearer " + Bench::token + "\r\n";
  auto page = std::async(std::launch::async, [&] {
    return http(bench, {.method = "GET", .target = "/", .headers = bearer, .body = ""}).status;
  });
  hangs.wait();
  EXPECT_FALSE(bench.server->answers(std::chrono::milliseconds(100)));
  go_on.set_value();
  EXPECT_EQ(page.get(), 404);
  EXPECT_TRUE(bench.server->answers(std::chrono::seconds(20)));
}

}  // namespace
}  // namespace ferrobench::server
