#include "server/queue/hooks.h"

#include <curl/curl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <memory>
#include <span>
#include <system_error>

#include "base/fields.h"
#include "recordings/process/child.h"

namespace ferrobench::server {

namespace {

constexpr std::size_t most_waiting = 64;
constexpr std::chrono::seconds hook_time{30};  // a mail, or a message through a web server that is slow
constexpr std::string_view hook_name = "ferrobench: tells";

// How the child ends that tells a web address.
constexpr int not_reached = 1, not_taken = 2;

bool is_address(std::string_view text) {
  return text.starts_with("http://") || text.starts_with("https://");
}

// As the child. What is answered is of no interest, but that it was taken.
int post(const char* address, const std::string& event, const std::string& facts) {
  const std::unique_ptr<CURL, void (*)(CURL*)> curl(curl_easy_init(), curl_easy_cleanup);
  if (!curl) return not_reached;
  const std::unique_ptr<curl_slist, void (*)(curl_slist*)> fields(
      curl_slist_append(nullptr, "Content-Type: application/json"), curl_slist_free_all);
  const auto body = R"({"event": ")" + event + R"(", "facts": )" + facts + "}";
  const auto pass_over = +[](char*, std::size_t size, std::size_t count, void*) { return size * count; };
  curl_easy_setopt(curl.get(), CURLOPT_URL, address);
  curl_easy_setopt(curl.get(), CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(curl.get(), CURLOPT_HTTPHEADER, fields.get());
  curl_easy_setopt(curl.get(), CURLOPT_POSTFIELDS, body.c_str());
  curl_easy_setopt(curl.get(), CURLOPT_POSTFIELDSIZE, static_cast<long>(body.size()));
  curl_easy_setopt(curl.get(), CURLOPT_WRITEFUNCTION, pass_over);
  curl_easy_setopt(curl.get(), CURLOPT_FAILONERROR, 1L);
  switch (curl_easy_perform(curl.get())) {
    case CURLE_OK:
      return EXIT_SUCCESS;
    case CURLE_HTTP_RETURNED_ERROR:
      return not_taken;
    default:
      return not_reached;
  }
}

// As the child.
[[gnu::constructor]] void tell_if_asked(int argc, char** argv) {
  if (argc != 4 || argv[0] != hook_name) return;
  recordings::be_a_child();
  if (is_address(argv[1])) _exit(post(argv[1], argv[2], argv[3]));
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
    const auto named = hook.substr(std::min(equals + 1, hook.size()));
    if (is_address(named)) {
      told_[event] = named;
      continue;
    }
    std::error_code failure;
    const auto program = std::filesystem::absolute(named, failure).string();
    if (!std::filesystem::is_regular_file(program, failure) || access(program.c_str(), X_OK) != 0)
      throw Error(ErrorCode::invalid_params, "this program cannot be run",
                  Problem{.message = "is no program",
                          .given = named,
                          .hint = "give EVENT=PROGRAM, a file that may be executed, or EVENT=https://..."});
    told_[event] = program;
  }
  if (!told_.empty()) thread_ = std::thread([this] { work(); });
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
  const auto found = told_.find(event_name(event));
  if (found == told_.end()) return;
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
      complain_(call.to + ", told of " + call.event + ", " + failure);
  }
}

// What went wrong, or "".
std::string Hooks::carry_out(const Call& call) {
  try {
    recordings::Child child(std::array{std::string(hook_name), call.to, call.event, call.facts});
    const auto end = std::chrono::steady_clock::now() + hook_time;
    while (!child.over()) {
      std::unique_lock lock(mutex_);
      if (changed_.wait_for(lock, std::chrono::milliseconds(20), [this] { return ending_; })) return "";
      if (std::chrono::steady_clock::now() > end)
        return "took longer than " + std::to_string(hook_time.count()) + " s";
    }
    const int status = child.end();
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
    if (is_address(call.to))
      return WIFEXITED(status) && WEXITSTATUS(status) == not_taken ? "did not take it" : "was not reached";
    return WIFEXITED(status) ? "ended with " + std::to_string(WEXITSTATUS(status)) : "died";
  } catch (const std::system_error& failure) {
    return "could not be started: " + failure.code().message();
  }
}

}  // namespace ferrobench::server
