#include "server/net/audit.h"

#include <fcntl.h>
#include <spdlog/async_logger.h>
#include <spdlog/details/thread_pool.h>
#include <spdlog/sinks/rotating_file_sink.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <system_error>

#include "recordings/disk/durable_file.h"

namespace ferrobench::server {
namespace {

constexpr std::size_t most_params = 2000;  // bytes

// Before anything is in it: there is no moment in which others may read it. A link that lies there gets no
// line, and a pipe without a reader is not waited for.
void make_private(const std::string& file) {
  const int fd =
      ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
  if (fd < 0) throw std::system_error(errno, std::generic_category(), file);
  static_cast<void>(fchmod(fd, 0600));
  close(fd);
}

// Where a full disk has taken the first bytes of a line only: the next line is not to be lost with it.
void cut_to_whole_lines(const std::string& file) {
  const recordings::Descriptor f(::open(file.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat info {};
  if (!f || fstat(f.get(), &info) != 0 || !S_ISREG(info.st_mode)) return;
  constexpr off_t longest = 1 << 16;  // of a line
  const auto from = std::max<off_t>(0, info.st_size - longest);
  std::string end(static_cast<std::size_t>(info.st_size - from), '\0');
  if (pread(f.get(), end.data(), end.size(), from) != static_cast<ssize_t>(end.size())) return;
  const auto whole = end.rfind('\n') + 1;  // 0 if there is none
  if (whole < end.size()) static_cast<void>(ftruncate(f.get(), from + static_cast<off_t>(whole)));
}

void hide(std::string& line, std::string_view secret) {
  if (secret.empty()) return;
  for (auto at = line.find(secret); at != std::string::npos; at = line.find(secret, at))
    line.replace(at, secret.size(), "...");
}

std::string text_of(const nlohmann::json& line) {
  return line.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

}  // namespace

class Audit::File {
 public:
  File(const std::filesystem::path& path, const AuditLimits& limits)
      : writer_(std::make_shared<spdlog::details::thread_pool>(limits.waiting, 1)) {
    spdlog::file_event_handlers handlers;
    handlers.before_open = make_private;
    auto sink = std::make_shared<spdlog::sinks::rotating_file_sink_mt>(path.string(), limits.max_bytes,
                                                                       limits.old_files, false, handlers);
    log_ = std::make_shared<spdlog::async_logger>("audit", std::move(sink), writer_,
                                                  spdlog::async_overflow_policy::overrun_oldest);
    log_->set_pattern(R"({"time":"%Y-%m-%dT%H:%M:%S.%eZ",%v)", spdlog::pattern_time_type::utc);
    log_->flush_on(spdlog::level::info);
    log_->set_error_handler([this, file = path.string()](const std::string&) {  // by the thread that writes
      ++failed_;
      cut_to_whole_lines(file);
    });
  }

  void write(const std::string& line) {
    log_->info(std::string_view(line).substr(1));
  }  // the time comes first
  std::uint64_t lost() const { return writer_->overrun_counter() + failed_; }

 private:
  std::atomic<std::uint64_t> failed_ = 0;
  std::shared_ptr<spdlog::async_logger> log_;
  std::shared_ptr<spdlog::details::thread_pool> writer_;  // ends first: writes what waits
};

Audit::Audit(const std::filesystem::path& folder, std::string secret, AuditLimits limits)
    : secret_(std::move(secret)) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (!failure) std::filesystem::permissions(folder, std::filesystem::perms::owner_all, failure);
  try {
    if (failure) throw std::system_error(failure);
    calls_ = std::make_unique<File>(folder / "calls.jsonl", limits);
    refusals_ = std::make_unique<File>(folder / "refusals.jsonl", limits);
  } catch (const std::exception& e) {
    throw Error(
        ErrorCode::io_error, "the audit log cannot be written",
        Problem{.message = e.what(),
                .given = folder.string(),
                .hint = "the bench is not to be controlled without one: check the folder's permissions"});
  }
}

Audit::~Audit() = default;

void Audit::call(const Call& call) {
  if (call.method == nullptr || (call.method->info.role == Role::view && !call.method->info.audited)) return;
  auto params = call.params;
  if (params.is_object() && params.contains("lease")) params["lease"] = "...";
  if (const auto bytes = text_of(params).size(); bytes > most_params) params = {{"bytes", bytes}};
  auto text = text_of({{"client", call.caller.client},
                       {"method", call.name},
                       {"outcome", call.outcome},
                       {"params", std::move(params)}});
  hide(text, secret_);
  calls_->write(text);
}

void Audit::refusal(std::string_view client, std::string_view request, const Refusal& refusal) {
  auto text = text_of({{"client", client},
                       {"request", request.substr(0, 200)},
                       {"status", refusal.status},
                       {"name", entry(refusal.code).name},
                       {"message", refusal.message}});
  hide(text, secret_);
  refusals_->write(text);
}

std::uint64_t Audit::lost() const {
  return calls_->lost() + refusals_->lost();
}

}  // namespace ferrobench::server
