#include "recordings/process/child.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/auxv.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <bit>
#include <cerrno>
#include <csignal>
#include <mutex>
#include <set>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/priority.h"

namespace ferrobench::recordings {
namespace {

std::mutex lock;  // over what follows
std::set<pid_t> under_way;
bool ended = false;

}  // namespace

Child::Child(std::span<const std::string> arguments, int input, int output) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  const auto give = [&files](int given, int as, int flags) {
    if (given >= 0)
      posix_spawn_file_actions_adddup2(&files, given, as);
    else
      posix_spawn_file_actions_addopen(&files, as, "/dev/null", flags, 0);
  };
  give(input, STDIN_FILENO, O_RDONLY);
  give(output, STDOUT_FILENO, O_WRONLY);
  give(-1, STDERR_FILENO, O_WRONLY);
  // No socket that it would keep open after this program's end, whoever forgot O_CLOEXEC.
  posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
  posix_spawnattr_t how;
  posix_spawnattr_init(&how);
  sigset_t none, usual;
  sigemptyset(&none);
  sigfillset(&usual);
  posix_spawnattr_setsigmask(&how, &none);
  posix_spawnattr_setsigdefault(&how, &usual);
  posix_spawnattr_setpgroup(&how, 0);
  posix_spawnattr_setflags(&how, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);

  std::vector<std::string> texts(arguments.begin(), arguments.end());
  std::vector<char*> given;
  for (auto& text : texts) given.push_back(text.data());
  given.push_back(nullptr);
  int failed = ECANCELED;
  {
    const std::scoped_lock holding(lock);
    if (!ended) failed = posix_spawn(&child_, "/proc/self/exe", &files, &how, given.data(), environ);
    if (failed == ENOENT)  // a root without /proc: by the path that this program was started by
      failed = posix_spawn(&child_, std::bit_cast<const char*>(getauxval(AT_EXECFN)), &files, &how,
                           given.data(), environ);
    if (failed == 0) under_way.insert(child_);
  }
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&how);
  if (failed == 0) return;
  child_ = 0;
  throw std::system_error(failed, std::generic_category());
}

bool Child::over() const {
  siginfo_t info{};
  return waitid(P_PID, static_cast<id_t>(child_), &info, WEXITED | WNOHANG | WNOWAIT) != 0 ||
         info.si_pid != 0;
}

int Child::end() {
  int status = 0;
  if (child_ == 0) return status;
  kill(-child_, SIGKILL);
  // A disk that hangs keeps it alive: others are not to wait for that. Its number is not another's before it
  // is reaped.
  siginfo_t dead{};
  while (waitid(P_PID, static_cast<id_t>(child_), &dead, WEXITED | WNOWAIT) < 0 && errno == EINTR) {
  }
  const std::scoped_lock holding(lock);
  while (waitpid(child_, &status, 0) < 0 && errno == EINTR) {
  }
  under_way.erase(child_);
  child_ = 0;
  return status;
}

void be_a_child() {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  allow(RLIMIT_CORE, 0);
  give_way();
  const int file = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
  if (file < 0) return;
  constexpr std::string_view first = "1000";
  [[maybe_unused]] const auto written = write(file, first.data(), first.size());
  close(file);
}

void allow(int resource, rlim_t most) {
  const rlimit limit{most, most};
  setrlimit(static_cast<__rlimit_resource>(resource), &limit);
}

void end_all_children() {
  const std::scoped_lock holding(lock);
  ended = true;
  for (const auto child : under_way) kill(-child, SIGKILL);
}

bool children_are_ended() {
  const std::scoped_lock holding(lock);
  return ended;
}

}  // namespace ferrobench::recordings
