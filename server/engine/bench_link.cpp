#include "server/engine/bench_link.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

#include "base/priority.h"
#include "base/unix_socket.h"
#include "server/bench/process.h"

namespace ferrobench::server {

using bench::Kind;
using recordings::Descriptor;

namespace {

constexpr std::chrono::milliseconds beat{100};  // how often the link says that it is alive
constexpr std::chrono::seconds most_silent{5};  // a bench that is silent for longer hangs
// For a stop. The bench's thread that takes it waits for nothing: on a busy machine it took 20 ms at most.
// After these 2 s another process starts within 1 s, and the output goes to zero by the amplifier's own slew.
constexpr std::chrono::seconds at_once{2};
constexpr std::chrono::seconds for_ready{10};
constexpr std::chrono::seconds for_leave{10};  // of a bench that has not answered: stop_time as it comes

// The time in which this process ran. It may have been stopped itself, and then what it waits for has had no
// chance: a look that comes later than this counts as this. So much a busy machine may hold up a thread.
class OwnTime {
 public:
  std::chrono::nanoseconds look() {
    constexpr std::chrono::milliseconds longest{500};
    const auto now = std::chrono::steady_clock::now();
    spent_ += std::min<std::chrono::nanoseconds>(now - looked_, longest);
    looked_ = now;
    return spent_;
  }

 private:
  std::chrono::steady_clock::time_point looked_ = std::chrono::steady_clock::now();
  std::chrono::nanoseconds spent_{};
};

}  // namespace

BenchLink::BenchLink(Descriptor socket, pid_t process) : process_(process), channel_(std::move(socket)) {}

std::shared_ptr<BenchLink> BenchLink::to_process() {
  auto process = bench::start_process();
  std::shared_ptr<BenchLink> out(new BenchLink(std::move(process.socket), process.number));
  if (!out->await_ready())
    throw Error(ErrorCode::device_unavailable, "the process of the bench did not start",
                Problem{.hint = "see the daemon's log, and how much memory is free"});
  out->start();
  return out;
}

std::shared_ptr<BenchLink> BenchLink::to_thread(bench::Opener open) {
  std::array<int, 2> ends{-1, -1};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw Error(ErrorCode::device_unavailable, "no bench can be started",
                Problem{.message = std::generic_category().message(errno)});
  std::shared_ptr<BenchLink> out(new BenchLink(Descriptor(ends[0]), 0));
  out->host_ = std::make_unique<bench::Host>(Descriptor(ends[1]), std::move(open), false);
  out->host_thread_ = std::thread([host = out->host_.get()] { host->serve(); });
  if (!out->await_ready()) throw Error(ErrorCode::device_unavailable, "the bench did not start");
  out->start();
  return out;
}

std::shared_ptr<BenchLink> BenchLink::taken_over(const std::string& path) {
  Descriptor socket(connect_unix(path));
  if (!socket || !is_trusted_peer(socket.get())) return nullptr;
  std::shared_ptr<BenchLink> out(new BenchLink(std::move(socket), 0));
  out->child_ = false;
  if (!out->await_ready()) return nullptr;
  out->process_ = static_cast<pid_t>(out->ready_.process);
  out->last_number_ = out->ready_.run;
  out->start();
  return out;
}

bool BenchLink::await_ready() {
  const auto until = std::chrono::steady_clock::now() + for_ready;
  try {
    while (std::chrono::steady_clock::now() < until) {
      pollfd wait{channel_.descriptor(), POLLIN, 0};
      poll(&wait, 1, static_cast<int>(beat.count()));
      const bool there = channel_.receive();
      if (const auto message = channel_.next()) {
        ready_ = message->as<bench::Ready>();
        return message->kind == Kind::ready;
      }
      if (!there) return false;
    }
  } catch (const bench::Damaged&) {
  }
  return false;
}

void BenchLink::start() {
  listener_ = std::thread([this] {
    take_precedence();
    listen();
  });
}

BenchLink::~BenchLink() {
  {
    const std::scoped_lock lock(mutex_);
    leaving_ = true;
    if (!lost_) channel_.send(bench::framed(bench::Leave{}));
  }
  nudge_.give();
  if (listener_.joinable()) listener_.join();
  if (host_thread_.joinable()) host_thread_.join();
  if (process_ > 0 && child_) see_it_leave();
}

// One that has a device which does not answer would wait for it for ever.
void BenchLink::see_it_leave() const {
  const auto until = std::chrono::steady_clock::now() + for_leave;
  while (hangs_ && waitpid(process_, nullptr, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > until) kill(process_, SIGKILL);
    usleep(10'000);
  }
  while (!hangs_ && waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

recordings::Descriptor BenchLink::take_journal() {
  const std::scoped_lock lock(mutex_);
  return channel_.take_file();
}

bool BenchLink::lost() const {
  const std::scoped_lock lock(mutex_);
  return lost_.has_value();
}

void BenchLink::watch(std::uint32_t run, RunWatcher* watcher) {
  const std::scoped_lock lock(watching_);
  if (watcher == nullptr)
    watchers_.erase(run);
  else if (loss_told_)
    watcher->lost(*loss_told_);
  else
    watchers_[run] = watcher;
}

void BenchLink::post(std::string frame, Descriptor file) {
  {
    const std::scoped_lock lock(mutex_);
    if (lost_) return;
    channel_.send(std::move(frame), std::move(file));
    channel_.flush();  // that nobody is there is seen by the listener
    if (channel_.bytes_queued() == 0) return;
  }
  nudge_.give();
}

std::string BenchLink::answer_to(std::uint64_t call, std::string frame,
                                 std::optional<std::chrono::seconds> patience) {
  if (auto body = await(call, std::move(frame), patience)) return std::move(*body);
  {
    const std::scoped_lock lock(mutex_);
    hangs_ = true;
  }
  throw Error(ErrorCode::device_unavailable, "the device does not answer",
              Problem{.message = "nothing within " + std::to_string(patience->count()) + " s",
                      .hint = "switch the amplifier off, unplug the device and plug it in again"});
}

void BenchLink::answer_at_once(std::uint64_t call, std::string frame) {
  // What runs in a thread of this process cannot be ended.
  if (await(call, std::move(frame), process_ > 0 ? std::optional(at_once) : std::nullopt)) return;
  {
    const std::scoped_lock lock(mutex_);
    unfit_ = "the bench process did not take a stop within " + std::to_string(at_once.count()) +
             " s and was ended";
  }
  nudge_.give();
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return lost_.has_value(); });
  throw Error(ErrorCode::device_lost, *lost_);
}

std::optional<std::string> BenchLink::await(std::uint64_t call, std::string frame,
                                            std::optional<std::chrono::seconds> patience) {
  {
    const std::scoped_lock lock(mutex_);
    waiting_[call];
  }
  post(std::move(frame), {});
  std::unique_lock lock(mutex_);
  const auto answered = [&] { return lost_ || waiting_[call].reply; };
  for (OwnTime time; !changed_.wait_for(lock, beat, answered) && !(patience && time.look() >= *patience);) {
  }
  const auto reply = std::move(waiting_[call].reply);
  waiting_.erase(call);
  if (!reply && !lost_) return std::nullopt;
  if (!reply) throw Error(ErrorCode::device_lost, *lost_);
  if (reply->failure) throw reply->failure->error();
  return reply->body;
}

void BenchLink::listen() {
  OwnTime silent;
  auto said = std::chrono::steady_clock::now() - beat;
  for (;;) {
    std::array<pollfd, 2> wait{{{channel_.descriptor(), POLLIN, 0}, nudge_.wanted()}};
    {
      const std::scoped_lock lock(mutex_);
      if (channel_.bytes_queued() > 0) wait[0].events |= POLLOUT;
    }
    poll(wait.data(), wait.size(), static_cast<int>(beat.count()));
    nudge_.take();
    const auto now = std::chrono::steady_clock::now();
    const bool say = now - said >= beat;
    bool there = false;
    std::vector<bench::Message> messages;
    std::string why = "the bench process has died";
    {
      const std::scoped_lock lock(mutex_);
      if (say && !leaving_) channel_.send(bench::framed(bench::Alive{}));
      there = channel_.receive();
      try {
        while (auto message = channel_.next()) messages.push_back(std::move(*message));
      } catch (const bench::Damaged& failure) {
        there = false;
        why = std::string("the bench process spoke in no known way: ") + failure.what();
      }
      there = channel_.flush() && there;
      if (!unfit_.empty()) {
        there = false;
        why = unfit_;
      }
    }
    if (say) said = now;
    const bool hangs = messages.empty() && silent.look() > most_silent;
    if (!messages.empty()) silent = {};
    try {
      for (const auto& message : messages) take(message);
    } catch (const bench::Damaged& failure) {
      there = false;
      why = std::string("the bench process spoke in no known way: ") + failure.what();
    }
    if (process_ > 0 && hangs) {
      there = false;
      why = "the bench process did not answer for 5 s and was ended";
    }
    if (!there) return die(why);
  }
}

void BenchLink::take(const bench::Message& message) {
  const auto watcher = [&](std::uint32_t run, const auto& call) {
    const std::scoped_lock lock(watching_);
    if (const auto found = watchers_.find(run); found != watchers_.end()) call(*found->second);
  };
  switch (message.kind) {
    case Kind::reply: {
      auto reply = message.as<bench::Reply>();
      const std::scoped_lock lock(mutex_);
      if (const auto found = waiting_.find(reply.call); found != waiting_.end())
        found->second.reply = std::move(reply);
      changed_.notify_all();
      return;
    }
    case Kind::status: {
      const auto said = message.as<bench::Status>();
      return watcher(said.run, [&](RunWatcher& w) { w.status(said.state); });
    }
    case Kind::event: {
      const auto said = message.as<bench::Noted>();
      return watcher(said.run, [&](RunWatcher& w) { w.event(said); });
    }
    case Kind::closed: {
      const auto said = message.as<bench::Closed>();
      return watcher(said.run, [&](RunWatcher& w) { w.closed(said); });
    }
    case Kind::alive:
      return;
    default:
      throw bench::Damaged("the bench does not say this");
  }
}

// Nothing of it may move an output, or hold a unit, any more. One that was taken over is not this process's
// child: it may have ended long before its parent takes note, and a descriptor tells that.
void BenchLink::see_it_dead() const {
  if (process_ <= 0) return;
  const Descriptor process(static_cast<int>(syscall(SYS_pidfd_open, process_, 0)));
  if (!process) {
    if (errno != ESRCH) kill(process_, SIGKILL);
    return;
  }
  syscall(SYS_pidfd_send_signal, process.get(), SIGKILL, nullptr, 0);
  constexpr std::chrono::milliseconds patience{1000};  // the kernel takes back what the process had
  pollfd ended{process.get(), POLLIN, 0};
  poll(&ended, 1, static_cast<int>(patience.count()));
  if (child_) waitpid(process_, nullptr, WNOHANG);
}

void BenchLink::die(const std::string& why) {
  bool leaving = false;
  {
    const std::scoped_lock lock(mutex_);
    leaving = leaving_;
    lost_ = why;
    shutdown(channel_.descriptor(), SHUT_RDWR);  // a bench that lives knows that it is alone
    changed_.notify_all();
  }
  if (leaving) return;
  {
    const std::scoped_lock lock(watching_);
    loss_told_ = why;
    for (const auto& [run, watcher] : watchers_) watcher->lost(why);
  }
  see_it_dead();
  loss_done_.set_value(when_lost ? when_lost() : "");
}

}  // namespace ferrobench::server
