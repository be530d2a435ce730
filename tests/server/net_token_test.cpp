#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "base/error.h"
#include "server/net/token.h"

namespace ferrobench::server {
namespace {

class NetToken : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder = std::filesystem::temp_directory_path() / ("token-" + std::to_string(getpid()) + test->name());
    std::filesystem::create_directories(folder);
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  std::string refusal(const std::filesystem::path& file) {
    try {
      load_or_create_token(file);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::io_error);
      EXPECT_FALSE(e.problems().at(0).hint.empty());
      return e.problems().at(0).message;
    }
    return "";
  }
  void put(const std::filesystem::path& file, const std::string& text, mode_t mode = 0600) {
    std::ofstream(file) << text;
    chmod(file.c_str(), mode);
  }
  std::filesystem::path folder;
};

TEST_F(NetToken, IsMadeOnceForItsOwnerOnly) {
  const auto file = folder / "state" / "ferrobench" / "token";
  const auto token = load_or_create_token(file);
  EXPECT_EQ(token.size(), 64u);
  EXPECT_EQ(token.find_first_not_of("0123456789abcdef"), std::string::npos);
  struct stat info {};
  ASSERT_EQ(stat(file.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  ASSERT_EQ(stat(file.parent_path().c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
  EXPECT_EQ(load_or_create_token(file), token);
  EXPECT_NE(load_or_create_token(folder / "other"), token);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(file.parent_path()), {}), 1)
      << "no draft is left";
}

TEST_F(NetToken, AFileNeedsNoFolderBeforeItsName) {
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder);
  const auto token = load_or_create_token("token");
  std::filesystem::current_path(before);
  EXPECT_EQ(load_or_create_token(folder / "token"), token);
}

TEST_F(NetToken, FirstStartsAtOnceAgree) {
  std::array<std::string, 4> tokens;
  std::vector<std::thread> threads;
  for (auto& token : tokens) threads.emplace_back([&] { token = load_or_create_token(folder / "token"); });
  for (auto& thread : threads) thread.join();
  for (const auto& token : tokens) EXPECT_EQ(token, tokens[0]);
}

TEST_F(NetToken, RefusesAFileThatIsNoSecret) {
  put(folder / "open", std::string(64, 'a') + "\n", 0644);
  EXPECT_EQ(refusal(folder / "open"), "others may read it");
  put(folder / "short", "abc\n");
  EXPECT_EQ(refusal(folder / "short"), "does not hold a token");
  put(folder / "empty", "");
  EXPECT_EQ(refusal(folder / "empty"), "does not hold a token");
  put(folder / "long", std::string(66, 'a'));
  EXPECT_EQ(refusal(folder / "long"), "does not hold a token");
  put(folder / "upper", std::string(64, 'X'));
  EXPECT_EQ(refusal(folder / "upper"), "does not hold a token");
  std::filesystem::create_directory(folder / "dir");
  EXPECT_EQ(refusal(folder / "dir"), "is not a plain file");
  put(folder / "target", std::string(64, 'a') + "\n");
  std::filesystem::create_symlink(folder / "target", folder / "link");
  EXPECT_NE(refusal(folder / "link"), "");
}

TEST_F(NetToken, SecretsCompare) {
  EXPECT_TRUE(equal_secret("abc", "abc"));
  EXPECT_FALSE(equal_secret("abc", "abd"));
  EXPECT_FALSE(equal_secret("abc", "ab"));
  EXPECT_FALSE(equal_secret("", "a"));
}

TEST_F(NetToken, StateFolderFollowsTheEnvironment) {
  const auto before = [](const char* name) { return std::string(getenv(name) ? getenv(name) : ""); };
  const auto xdg = before("XDG_STATE_HOME"), home = before("HOME");
  setenv("XDG_STATE_HOME", "/x", 1);
  EXPECT_EQ(state_folder(), "/x/ferrobench");
  setenv("XDG_STATE_HOME", "relative", 1);
  setenv("HOME", "/h", 1);
  EXPECT_EQ(state_folder(), "/h/.local/state/ferrobench");
  unsetenv("HOME");
  EXPECT_THROW(state_folder(), Error);
  xdg.empty() ? unsetenv("XDG_STATE_HOME") : setenv("XDG_STATE_HOME", xdg.c_str(), 1);
  if (!home.empty()) setenv("HOME", home.c_str(), 1);
}

}  // namespace
}  // namespace ferrobench::server
