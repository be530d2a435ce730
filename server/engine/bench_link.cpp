#include "server/engine/bench_link.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

#include "base/unix_socket.h"
#include "server/bench/process.h"

namespace ferrobench::server {

using bench::Kind;
using recordings::Descriptor;

namespace {

constexpr std::chrono::milliseconds beat{100};  // how often the link says that it is alive
constexpr int most_silent_beats = 50;           // 5 s; a bench that is silent for longer hangs
constexpr std::chrono::seconds for_ready{10};

}  // namespace

BenchLink::BenchLink(Descriptor socket, pid_t process)
    : process_(process), nudge_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)), channel_(std::move(socket)) {}

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
  listener_ = std::thread([this] { listen(); });
}

BenchLink::~BenchLink() {
  {
    const std::scoped_lock lock(mutex_);
    leaving_ = true;
    if (!lost_) channel_.send(bench::framed(bench::Leave{}));
  }
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(nudge_.get(), &one, sizeof one);
  if (listener_.joinable()) listener_.join();
  if (host_thread_.joinable()) host_thread_.join();
  if (process_ > 0 && child_) {
    while (waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
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
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(nudge_.get(), &one, sizeof one);
}

std::string BenchLink::answer_to(std::uint64_t call, std::string frame, Descriptor file) {
  {
    const std::scoped_lock lock(mutex_);
    waiting_[call];
  }
  post(std::move(frame), std::move(file));
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return lost_ || waiting_[call].reply; });
  const auto reply = std::move(waiting_[call].reply);
  waiting_.erase(call);
  if (!reply) throw Error(ErrorCode::device_lost, *lost_);
  if (reply->failure) throw reply->failure->error();
  return reply->body;
}

void BenchLink::listen() {
  int silent = 0;
  auto said = std::chrono::steady_clock::now() - beat;
  for (;;) {
    std::array<pollfd, 2> wait{{{channel_.descriptor(), POLLIN, 0}, {nudge_.get(), POLLIN, 0}}};
    {
      const std::scoped_lock lock(mutex_);
      if (channel_.bytes_queued() > 0) wait[0].events |= POLLOUT;
    }
    poll(wait.data(), wait.size(), static_cast<int>(beat.count()));
    std::uint64_t nudges = 0;
    [[maybe_unused]] const auto taken = read(nudge_.get(), &nudges, sizeof nudges);
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
    }
    // In beats of this process, which may have been stopped itself.
    if (say) {
      said = now;
      ++silent;
    }
    if (!messages.empty()) silent = 0;
    try {
      for (const auto& message : messages) take(message);
    } catch (const bench::Damaged& failure) {
      there = false;
      why = std::string("the bench process spoke in no known way: ") + failure.what();
    }
    if (process_ > 0 && silent > most_silent_beats) {
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

// Nothing of it may move an output, or hold a unit, any more.
void BenchLink::see_it_dead() const {
  if (process_ <= 0) return;
  kill(process_, SIGKILL);
  for (int i = 0; i < 100 && kill(process_, 0) == 0; ++i) {
    if (child_ && waitpid(process_, nullptr, WNOHANG) == process_) return;
    usleep(10'000);
  }
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
    for (const auto& [run, watcher] : watchers_) watcher->lost(why);
  }
  see_it_dead();
  loss_done_.set_value(when_lost ? when_lost() : "");
}

}  // namespace ferrobench::server
