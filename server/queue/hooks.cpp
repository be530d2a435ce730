#include "server/queue/hooks.h"

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <span>
#include <system_error>

#include "base/fields.h"
#include "recordings/process/child.h"

namespace ferrobench::server {

namespace {

constexpr std::size_t most_waiting = 64;
constexpr std::chrono::seconds hook_time{30};  // a mail, or a message through a web server that is slow
constexpr std::string_view hook_name = "ferrobench: tells";

// As the child.
[[gnu::constructor]] void tell_if_asked(int argc, char** argv) {
  if (argc != 4 || argv[0] != hook_name) return;
  recordings::be_a_child();
  execl(argv[1], argv[1], argv[2], argv[3], nullptr);
  _exit(127);
}

std::string event_name(HookEvent event) {
  return write_json(event).get<std::string>();
}

}  // namespace

std::span<const std::pair<HookEvent, std::string_view>> enum_names(HookEvent) {
  static constexpr std::array<std::pair<HookEvent, std::string_view>, 4> names{
      {{HookEvent::run_ended, "run_ended"},
       {HookEvent::limit_tripped, "limit_tripped"},
       {HookEvent::queue_empty, "queue_empty"},
       {HookEvent::queue_stopped, "queue_stopped"}}};
  return names;
}

Hooks::Hooks(const std::vector<std::string>& given, std::function<void(const std::string&)> complain)
    : complain_(std::move(complain)) {
  for (const auto& hook : given) {
    const auto equals = std::min(hook.find('='), hook.size());
    const auto event = event_name(parse<HookEvent>(hook.substr(0, equals), ErrorCode::invalid_params,
                                                   "the event of \"" + excerpt(hook) + "\""));
    std::error_code failure;
    const std::filesystem::path named(hook.substr(std::min(equals + 1, hook.size())));
    const auto program = std::filesystem::absolute(named, failure).string();
    if (!std::filesystem::is_regular_file(program, failure) || access(program.c_str(), X_OK) != 0)
      throw Error(ErrorCode::invalid_params, "this program cannot be run",
                  Problem{.message = "is no program",
                          .given = named.string(),
                          .hint = "give EVENT=PROGRAM, a file that may be executed"});
    programs_[event] = program;
  }
  if (!programs_.empty()) thread_ = std::thread([this] { work(); });
}

Hooks::~Hooks() {
  {
    const std::scoped_lock lock(mutex_);
    ending_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

void Hooks::tell(HookEvent event, const nlohmann::json& facts) {
  const auto found = programs_.find(event_name(event));
  if (found == programs_.end()) return;
  const std::scoped_lock lock(mutex_);
  waiting_.push_back(
      {found->second, found->first, facts.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)});
  if (waiting_.size() > most_waiting) waiting_.pop_front();
  changed_.notify_all();
}

void Hooks::work() {
  for (;;) {
    Call call;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return ending_ || !waiting_.empty(); });
      if (ending_) return;
      call = std::move(waiting_.front());
      waiting_.pop_front();
    }
    if (const auto failure = carry_out(call); !failure.empty())
      complain_(call.program + ", told of " + call.event + ", " + failure);
  }
}

// What went wrong, or "".
std::string Hooks::carry_out(const Call& call) {
  try {
    recordings::Child child(std::array{std::string(hook_name), call.program, call.event, call.facts});
    const auto end = std::chrono::steady_clock::now() + hook_time;
    while (!child.over()) {
      std::unique_lock lock(mutex_);
      if (changed_.wait_for(lock, std::chrono::milliseconds(20), [this] { return ending_; })) return "";
      if (std::chrono::steady_clock::now() > end)
        return "took longer than " + std::to_string(hook_time.count()) + " s";
    }
    const int status = child.end();
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
    return WIFEXITED(status) ? "ended with " + std::to_string(WEXITSTATUS(status)) : "died";
  } catch (const std::system_error& failure) {
    return "could not be started: " + failure.code().message();
  }
}

}  // namespace ferrobench::server
