#include "server/batch/slurm.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <set>
#include <sstream>
#include <thread>

#include "base/visible.h"

namespace ferrobench::batch {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

namespace {

struct Said {
  int code = 0;      // 127: there is no such program
  std::string text;  // of both outputs
};

// Of its own group, so that Ctrl-C is this program's affair.
Said run(std::vector<std::string> words) {
  std::array<int, 2> ends{-1, -1};
  if (pipe2(ends.data(), O_CLOEXEC) != 0)
    throw Error(ErrorCode::io_error, "no pipe can be made",
                Problem{.hint = "see how many open files are allowed"});
  const recordings::Descriptor out(ends[0]);
  recordings::Descriptor in(ends[1]);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, in.get(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&files, in.get(), STDERR_FILENO);
  posix_spawnattr_t how;
  posix_spawnattr_init(&how);
  posix_spawnattr_setpgroup(&how, 0);
  posix_spawnattr_setflags(&how, POSIX_SPAWN_SETPGROUP);
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t child = 0;
  const int failed = posix_spawnp(&child, words[0].c_str(), &files, &how, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&how);
  if (failed != 0) return {.code = 127, .text = ""};
  in = recordings::Descriptor();
  Said said;
  std::array<char, 4096> portion{};
  for (;;) {
    const auto got = read(out.get(), portion.data(), portion.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    said.text.append(portion.data(), static_cast<std::size_t>(got));
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  said.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return said;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

struct Tasks {
  bool known = false;  // Slurm has answered
  std::size_t waiting = 0, running = 0;
  bool cancelled = false;
  bool active() const { return waiting + running > 0; }
};

// Of tasks that are over Slurm forgets the state after a while (MinJobAge).
Tasks ask(const std::string& job) {
  const auto said = run({"squeue", "--noheader", "--array", "--states=all", "--format=%T", "--jobs=" + job});
  Tasks out;
  if (said.code != 0) {  // "Invalid job id specified": all are forgotten
    out.known = said.code == 127 || said.text.find("Invalid job id") != std::string::npos;
    return out;
  }
  out.known = true;
  static constexpr std::array<std::string_view, 10> over{
      "COMPLETED", "FAILED",    "CANCELLED", "TIMEOUT", "NODE_FAIL",
      "DEADLINE",  "BOOT_FAIL", "PREEMPTED", "REVOKED", "OUT_OF_MEMORY"};
  for (const auto& state : lines_of(said.text)) {
    if (state == "CANCELLED") out.cancelled = true;
    if (std::ranges::find(over, state) != over.end()) continue;
    // While its end is being written down, a task is still there.
    ++(state == "RUNNING" || state == "COMPLETING" ? out.running : out.waiting);
  }
  return out;
}

// As a word of the shell.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

// As sbatch reads a file's name.
std::string without_percents(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '%' ? std::string("%%") : std::string(1, c);
  return out;
}

std::string submit(const Batch& batch, const std::vector<Place>& places, const SlurmOptions& options) {
  const auto& folder = batch.folder();
  const auto threads = std::to_string(batch.options().threads);
  const auto script = folder.path() / "task.sh";
  put_text(script, "#!/bin/sh\nexec " + quoted(fs::read_symlink("/proc/self/exe").string()) + " batch work " +
                       quoted(folder.path().string()) + " \"$SLURM_ARRAY_TASK_ID\" --threads " + threads +
                       "\n");
  std::vector<std::string> words{"sbatch",
                                 "--parsable",
                                 "--requeue",
                                 "--ntasks=1",
                                 "--cpus-per-task=" + threads,
                                 "--array=" + array_of(places),
                                 "--job-name=ferrobench-" + kind_name(batch.plan().kind),
                                 "--open-mode=append",
                                 "--chdir=/",
                                 "--output=" + without_percents(folder.logs().string()) + "/slurm-%A_%a.txt"};
  if (!options.partition.empty()) words.push_back("--partition=" + options.partition);
  if (!options.time.empty()) words.push_back("--time=" + options.time);
  words.insert(words.end(), options.options.begin(), options.options.end());
  words.push_back(script.string());
  const auto said = run(words);
  std::string job;
  for (const auto& line : lines_of(said.text)) {  // a number, or "number;cluster", beside what it warns of
    const auto number = line.substr(0, line.find(';'));
    if (!number.empty() && number.find_first_not_of("0123456789") == std::string::npos) job = number;
  }
  if (said.code == 0 && !job.empty()) {
    folder.put_job(job);
    return job;
  }
  if (said.code == 127)
    throw Error(
        ErrorCode::device_unavailable, "there is no Slurm here: sbatch was not found",
        Problem{.path = "/slurm",
                .hint = "install its client (Debian: slurm-client), load its module, or use --local"});
  throw Error(
      ErrorCode::bad_state, "sbatch has refused the batch",
      Problem{.path = "/slurm",
              .message = in_one_line(said.text),
              .hint = "give what it wants by --partition, --time or --sbatch-option; of more tasks than the "
                      "cluster allows a larger --chunk makes fewer"});
}

std::string in_words(const Tasks& tasks) {
  return std::to_string(tasks.running) + " tasks at work, " + std::to_string(tasks.waiting) + " waiting";
}

// Until none of the job's tasks waits or runs, or the caller wants no more. `end.goes_on` says which.
void wait_for(const std::string& job, const Batch& batch, SlurmEnd& end) {
  using std::chrono::milliseconds;
  // The controller serves the whole cluster, so it is asked ever less.
  constexpr milliseconds first(500), last(15000), at_the_end(100);
  auto pause = first;
  auto next = Clock::now();
  Tasks tasks;
  for (end.goes_on = true;;) {
    if (Clock::now() >= next) {
      tasks = ask(job);
      if (tasks.known && !tasks.active()) break;
      next = Clock::now() + pause;
      pause = std::min(last, 2 * pause);
    }
    const auto look = Clock::now();
    const auto over = batch.to_do().size() - batch.missing().size();
    const bool all = over == batch.to_do().size();  // its end is near
    const auto cost = Clock::now() - look;
    if (!batch.tell("job " + job + ": " + (tasks.known ? in_words(tasks) : "Slurm does not answer"), over))
      return;
    if (all) next = std::min(next, Clock::now() + at_the_end);
    std::this_thread::sleep_for(std::max<Clock::duration>(all ? at_the_end : milliseconds(200), 20 * cost));
  }
  end.goes_on = false;
  end.cancelled = tasks.cancelled;
}

}  // namespace

std::string array_of(const std::vector<Place>& places) {
  std::set<std::int64_t> numbers;
  for (const auto& place : places) numbers.insert(place.task);
  const std::vector<std::int64_t> tasks(numbers.begin(), numbers.end());
  std::string out;
  for (std::size_t i = 0; i < tasks.size();) {
    auto last = i;
    while (last + 1 < tasks.size() && tasks[last + 1] == tasks[last] + 1) ++last;
    out += (out.empty() ? "" : ",") + std::to_string(tasks[i]);
    if (last > i) out += "-" + std::to_string(tasks[last]);
    i = last + 1;
  }
  return out;
}

bool is_at_work(const BatchFolder& folder) {
  const auto job = folder.job();
  if (job.empty()) return false;
  const auto tasks = ask(job);
  return !tasks.known || tasks.active();
}

SlurmEnd run_by_slurm(Batch& batch, const SlurmOptions& options) {
  SlurmEnd end;
  if (is_at_work(batch.folder())) {
    end.job = batch.folder().job();
    if (!batch.is_planned())
      throw Error(
          ErrorCode::busy, "job " + end.job + " is at work in this folder, on another manifest",
          Problem{.path = "/out",
                  .given = batch.folder().path().string(),
                  .hint = "wait for it, end it by 'scancel " + end.job + "', or name another folder"});
    batch.join();
  } else {
    batch.prepare();
    if (batch.to_do().empty()) return end;
    end.job = submit(batch, batch.to_do(), options);
  }
  for (auto before = batch.missing().size();;) {
    end.goes_on = true;
    if (!options.wait) return end;
    wait_for(end.job, batch, end);
    const auto left = batch.missing();
    // What an array has not brought, the next one would not bring either.
    if (end.goes_on || end.cancelled || left.empty() || left.size() == before) return end;
    before = left.size();
    end.job = submit(batch, left, options);
  }
}

}  // namespace ferrobench::batch
