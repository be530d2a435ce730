#include "recordings/process/child.h"

#include <fcntl.h>
#include <sched.h>
#include <spawn.h>
#include <sys/auxv.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
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

// A descriptor of this process, or -1 for /dev/null, as one of the child's three.
void give(posix_spawn_file_actions_t& files, int given, int as, int flags) {
  if (given >= 0)
    posix_spawn_file_actions_adddup2(&files, given, as);
  else
    posix_spawn_file_actions_addopen(&files, as, "/dev/null", flags, 0);
}

// This program once more with these three descriptors. 0 or the errno.
int start(pid_t& child, std::span<const std::string> arguments, std::array<int, 3> given, short apart,
          int priority = 0) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  give(files, given[0], STDIN_FILENO, O_RDONLY);
  give(files, given[1], STDOUT_FILENO, O_WRONLY);
  give(files, given[2], STDERR_FILENO, O_WRONLY);
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
  if (priority > 0) {
    const sched_param wanted{.sched_priority = priority};
    posix_spawnattr_setschedpolicy(&how, SCHED_RR);
    posix_spawnattr_setschedparam(&how, &wanted);
    apart = static_cast<short>(apart | POSIX_SPAWN_SETSCHEDULER);
  }
  posix_spawnattr_setflags(&how, static_cast<short>(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | apart));

  std::vector<std::string> texts(arguments.begin(), arguments.end());
  std::vector<char*> words;
  words.reserve(texts.size() + 1);
  for (auto& text : texts) words.push_back(text.data());
  words.push_back(nullptr);
  int failed = posix_spawn(&child, "/proc/self/exe", &files, &how, words.data(), environ);
  if (failed == ENOENT)  // a root without /proc: by the path that this program was started by
    failed = posix_spawn(&child, std::bit_cast<const char*>(getauxval(AT_EXECFN)), &files, &how, words.data(),
                         environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&how);
  return failed;
}

}  // namespace

Child::Child(std::span<const std::string> arguments, int input, int output) {
  int failed = ECANCELED;
  {
    const std::scoped_lock holding(lock);
    if (!ended) failed = start(child_, arguments, {input, output, -1}, POSIX_SPAWN_SETPGROUP);
    if (failed == 0) under_way.insert(child_);
  }
  if (failed == 0) return;
  child_ = 0;
  throw std::system_error(failed, std::generic_category());
}

pid_t start_apart(const std::string& name, int socket, int priority) {
  pid_t child = 0;
  const std::array<int, 3> given{socket, -1, STDERR_FILENO};
  int failed = start(child, {&name, 1}, given, POSIX_SPAWN_SETSID, priority);
  if (failed == EPERM && priority > 0) failed = start(child, {&name, 1}, given, POSIX_SPAWN_SETSID);
  if (failed != 0) throw std::system_error(failed, std::generic_category());
  return child;
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
