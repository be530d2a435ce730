// The audit log: who did what and who was refused, without a secret, in files that stay small and for their
// owner.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "engine_bench.h"
#include "net_bench.h"
#include "server/net/audit.h"
#include "server/net/client.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

std::vector<json> lines_of(const std::filesystem::path& file) {
  std::vector<json> out;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    out.push_back(json::parse(line, nullptr, false));
    EXPECT_TRUE(out.back().is_object()) << line;
  }
  return out;
}

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

class AuditTest : public testing::Test {
 protected:
  AuditTest() {
    rpc.add<NoParams>({.name = "look", .doc = "looks"}, [](const NoParams&) {});
    rpc.add<NoParams>({.name = "note", .doc = "looks, audited", .audited = true}, [](const NoParams&) {});
    rpc.add(make_method<NoParams>({.name = "change", .doc = "changes", .role = Role::control},
                                  [](const NoParams&) {}));
    rpc.add<NoParams>({.name = "stop", .doc = "stops", .role = Role::stop}, [](const NoParams&) {});
  }
  void observe(Audit& audit) {
    rpc.set_observer([&audit](const Call& call) { audit.call(call); });
  }
  void say(const std::string& method, const json& params = json::object()) {
    rpc.handle(json{{"jsonrpc", "2.0"}, {"method", method}, {"params", params}, {"id", 1}}.dump(), caller);
  }
  std::filesystem::path calls() const { return audit_folder / "calls.jsonl"; }

  Folder folder;
  std::filesystem::path audit_folder = folder.path / "audit";
  Dispatcher rpc;
  CallContext caller{.client = "unix 1 user 1000 process 7", .lease = "", .subscriber = nullptr};
};

TEST_F(AuditTest, KeepsAccountOfWhatControlsOrStopsAndOfNothingElse) {
  {
    Audit audit(audit_folder, Bench::token);
    observe(audit);
    for (const auto* method : {"look", "note", "change", "stop", "nothing"}) say(method);
    say("change", {{"unknown", 1}});
    rpc.handle(R"({"jsonrpc":"2.0","method":"stop"})", caller);
    rpc.handle("nonsense", caller);
  }
  const auto lines = lines_of(calls());
  std::vector<std::string> said;
  for (const auto& line : lines) {
    said.push_back(line["method"].get<std::string>() + " " + line["outcome"].get<std::string>());
    EXPECT_EQ(line["client"], caller.client);
    EXPECT_EQ(line["time"].get<std::string>().size(), std::string("2026-01-01T00:00:00.000Z").size());
  }
  EXPECT_EQ(said, (std::vector<std::string>{"note ok", "change ok", "stop ok", "change invalid_params",
                                            "stop ok"}));
  EXPECT_EQ(lines[3]["params"], (json{{"unknown", 1}}));
}

TEST_F(AuditTest, HoldsNoSecretAndStaysOneLineACall) {
  {
    Audit audit(audit_folder, Bench::token);
    observe(audit);
    say("change", {{"lease", "11111111-2222"}, {"notes", "the token is " + Bench::token + "\nand \"more\""}});
    say("change", {{Bench::token, 1}});
    say("change", {{"protocol", std::string(100'000, 'x')}});
    say("change", {{"text", "\x01 \xe2\x82\xac"}});
    audit.refusal("http 127.0.0.1 port 1", "GET /" + Bench::token,
                  Refusal{.status = 404, .message = Bench::token});
  }
  const auto lines = lines_of(calls());
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_EQ(lines[0]["params"]["lease"], "...");
  EXPECT_EQ(lines[0]["params"]["notes"], "the token is ...\nand \"more\"");
  EXPECT_GT(lines[2]["params"]["bytes"], 100'000);
  EXPECT_EQ(text_of(calls()).find(Bench::token), std::string::npos);
  EXPECT_EQ(text_of(audit_folder / "refusals.jsonl").find(Bench::token), std::string::npos);
  EXPECT_EQ(lines_of(audit_folder / "refusals.jsonl").size(), 1u);
}

TEST_F(AuditTest, GrowsAtTheEndAndIsForItsOwnerOnly) {
  for (int start = 1; start <= 3; ++start) {
    Audit audit(audit_folder, Bench::token);
    observe(audit);
    say("change");
  }
  EXPECT_EQ(lines_of(calls()).size(), 3u);
  const auto mode_of = [](const std::filesystem::path& path) {
    struct stat info {};
    EXPECT_EQ(stat(path.c_str(), &info), 0);
    return info.st_mode & 0777;
  };
  EXPECT_EQ(mode_of(audit_folder), 0700u);
  EXPECT_EQ(mode_of(calls()), 0600u);
  EXPECT_EQ(mode_of(audit_folder / "refusals.jsonl"), 0600u);
}

TEST_F(AuditTest, TurnsToNewFilesAndKeepsAFewOldOnes) {
  {
    Audit audit(audit_folder, Bench::token, {.max_bytes = 2000, .old_files = 3, .waiting = 10'000});
    observe(audit);
    for (int i = 0; i < 200; ++i) say("change", {{"number", i}});
    for (int i = 0; i < 200; ++i) audit.refusal("http", "GET /", Refusal{.status = 401});
    EXPECT_EQ(audit.lost(), 0u);
  }
  std::vector<std::string> files;
  int newest = -1, last = 200;
  for (const auto* name : {"calls.jsonl", "calls.1.jsonl", "calls.2.jsonl", "calls.3.jsonl"}) {
    const auto lines = lines_of(audit_folder / name);
    ASSERT_FALSE(lines.empty()) << name;
    EXPECT_LE(std::filesystem::file_size(audit_folder / name), 2000u);
    struct stat info {};
    EXPECT_EQ(stat((audit_folder / name).c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0600u);
    newest = std::max(newest, lines.back()["params"]["number"].get<int>());
    EXPECT_EQ(lines.back()["params"]["number"], last - 1) << "no line is missing between the files";
    last = lines.front()["params"]["number"].get<int>();
  }
  EXPECT_EQ(newest, 199) << "refusals push out no calls";
  EXPECT_FALSE(std::filesystem::exists(audit_folder / "calls.4.jsonl"));
}

// The file is a pipe that nobody reads, until the very end: whoever waited for it would wait for ever.
TEST_F(AuditTest, NobodyWaitsForTheDisk) {
  std::filesystem::create_directories(audit_folder);
  ASSERT_EQ(mkfifo(calls().c_str(), 0600), 0);
  const int reader = open(calls().c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  std::atomic<bool> over{false};
  std::thread late;
  {
    Audit audit(audit_folder, Bench::token, {.max_bytes = 1u << 30, .waiting = 16});
    observe(audit);
    for (int i = 0; i < 5000; ++i) say("stop", {{"pad", std::string(100, 'x')}});
    EXPECT_GT(audit.lost(), 1000u);
    late = std::thread([&] {
      std::array<char, 4096> chunk{};
      while (!over)
        if (read(reader, chunk.data(), chunk.size()) <= 0) usleep(1000);
    });
  }
  over = true;
  late.join();
  close(reader);
}

// A file that may not grow is as a full disk is: what does not fit is lost, in the middle of a line at first.
TEST_F(AuditTest, WhatAFullDiskCostsIsCountedAndSpoilsNothingElse) {
  constexpr int all = 100;
  std::uint64_t lost = 0;
  const auto before = std::signal(SIGXFSZ, SIG_IGN);
  rlimit usual{};
  getrlimit(RLIMIT_FSIZE, &usual);
  {
    Audit audit(audit_folder, Bench::token);
    observe(audit);
    rlimit small = usual;
    small.rlim_cur = 5000;
    setrlimit(RLIMIT_FSIZE, &small);
    for (int i = 0; i < all; ++i) say("stop", {{"number", i}});
    for (int i = 0; i < 500 && audit.lost() == 0; ++i) usleep(10'000);
    usleep(200'000);
    setrlimit(RLIMIT_FSIZE, &usual);
    say("stop", {{"number", "there is room again"}});
    for (int i = 0; i < 500 && text_of(calls()).find("room again") == std::string::npos; ++i) usleep(10'000);
    lost = audit.lost();
  }
  static_cast<void>(std::signal(SIGXFSZ, before));
  const auto lines = lines_of(calls());
  EXPECT_GT(lines.size(), 5u);
  EXPECT_GT(lost, 10u);
  EXPECT_EQ(lines.size() + lost, static_cast<std::size_t>(all + 1));
  EXPECT_EQ(lines.back()["params"]["number"], "there is room again");
}

TEST_F(AuditTest, AFolderThatCannotBeWrittenIsAnError) {
  std::ofstream(folder.path / "file") << "x";
  EXPECT_EQ(code_of([&] { Audit(folder.path / "file", Bench::token); }), ErrorCode::io_error);
}

TEST_F(AuditTest, NoLinkGetsALine) {
  std::ofstream(folder.path / "precious") << "precious";
  for (const auto* name : {"calls.jsonl", "refusals.jsonl"}) {
    std::filesystem::create_directories(audit_folder);
    std::filesystem::create_symlink(folder.path / "precious", audit_folder / name);
    EXPECT_EQ(code_of([&] { Audit(audit_folder, Bench::token); }), ErrorCode::io_error) << name;
    std::filesystem::remove_all(audit_folder);
  }
  EXPECT_EQ(std::filesystem::file_size(folder.path / "precious"), 8u);
}

TEST_F(AuditTest, ThroughTheDoor) {
  std::uint16_t port = 0;
  {
    Audit audit(audit_folder, Bench::token);
    Bench bench({}, [&audit](Bench& b, Content& content) {
      b.rpc.set_observer([&audit](const Call& call) { audit.call(call); });
      b.rpc.set_gate([](const Method&, const CallContext& c) {
        if (c.lease == "wrong") throw Error(ErrorCode::not_controller, "another client controls the bench");
      });
      content.refused = [&audit](std::string_view client, std::string_view request, const Refusal& refusal) {
        audit.refusal(client, request, refusal);
      };
    });
    port = bench.port();
    const auto bearer = "Authorization: Bearer " + Bench::token + "\r\nContent-Type: application/json\r\n";
    EXPECT_EQ(http(bench, {}).status, 200);
    EXPECT_EQ(http(bench, {.headers = bearer + "Ferrobench-Lease: wrong\r\n"}).status, 200);
    Client::connect(bench.socket_path()).call("stop");
    http(bench, {.host = "evil.example"});
    http(bench, {.headers = ""});
    http(bench, {.method = "GET", .target = "/?token=" + Bench::token + "0", .headers = "", .body = ""});
    http(bench, {.method = "GET", .target = "/nothing", .headers = bearer, .body = ""});
    raw_exchange(port, "nonsense\r\n\r\n");
  }
  const auto calls_made = lines_of(calls());
  ASSERT_EQ(calls_made.size(), 3u);
  EXPECT_TRUE(calls_made[0]["client"].get<std::string>().starts_with("http 127.0.0.1 port "));
  EXPECT_EQ(calls_made[0]["outcome"], "ok");
  EXPECT_EQ(calls_made[1]["outcome"], "not_controller");
  const auto local = calls_made[2]["client"].get<std::string>();
  EXPECT_NE(local.find(" user " + std::to_string(getuid()) + " process " + std::to_string(getpid())),
            std::string::npos)
      << local;
  std::vector<std::pair<int, std::string>> refused;
  for (const auto& line : lines_of(audit_folder / "refusals.jsonl"))
    refused.emplace_back(line["status"], line["request"]);
  EXPECT_EQ(refused,
            (std::vector<std::pair<int, std::string>>{
                {403, "POST /rpc"}, {401, "POST /rpc"}, {401, "GET /"}, {404, "GET /nothing"}, {400, " "}}));
  EXPECT_EQ(text_of(audit_folder / "refusals.jsonl").find(Bench::token), std::string::npos);
}

}  // namespace
}  // namespace ferrobench::server
