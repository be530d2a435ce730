#include "server/bench/host.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>

#include "base/unix_socket.h"
#include "daq/not_at_zero.h"

namespace ferrobench::bench {

namespace {

constexpr std::chrono::milliseconds status_interval{50};
constexpr std::chrono::milliseconds look_interval{250};  // at the silence of the server
constexpr std::size_t most_queued = 1u
                                    << 20;  // bytes for a server that does not read; then events are missed
constexpr std::size_t most_works = 64;

bool same(const RunState& a, const RunState& b) {
  return a.guard == b.guard && a.end == b.end && a.output_at_zero == b.output_at_zero;
}

}  // namespace

Host::Host(Descriptor server, Opener open, bool process, std::string lacks)
    : open_(std::move(open)), process_(process), lacks_(std::move(lacks)) {
  server_.emplace(std::move(server));
  send(framed(Ready{.process = getpid(), .lacks = lacks_}));
}

Host::~Host() {
  reap(true);
  if (door_) unlink(door_path_.c_str());
}

void Host::add_device(std::uint32_t number, std::shared_ptr<daq::Device> device) {
  const std::scoped_lock lock(mutex_);
  devices_[number] = std::move(device);
}

std::shared_ptr<daq::Device> Host::device(std::uint32_t number) const {
  const std::scoped_lock lock(mutex_);
  const auto found = devices_.find(number);
  return found == devices_.end() ? nullptr : found->second;
}

std::shared_ptr<daq::Device> Host::demand_device(std::uint32_t number) const {
  auto out = device(number);
  if (!out) throw Error(ErrorCode::device_lost, "the bench has no such device any more");
  return out;
}

void Host::serve() {
  while (!finished()) {
    std::array<pollfd, 3> wait{{nudge_.wanted(), {-1, POLLIN, 0}, {door_.get(), POLLIN, 0}}};
    if (server_) {
      wait[1].fd = server_->descriptor();
      if (server_->bytes_queued() > 0) wait[1].events |= POLLOUT;
    }
    poll(wait.data(), wait.size(), static_cast<int>(look_interval.count()));
    nudge_.take();
    if (server_ && (wait[1].revents & (POLLIN | POLLHUP | POLLERR)) != 0) hear();
    if (door_ && (wait[2].revents & POLLIN) != 0) take_over();
    watch_server();
    tell();
    reap(false);
  }
  std::map<std::uint32_t, Running> runs;
  {
    const std::scoped_lock lock(mutex_);
    test_stop_ = shuts_down;
    runs.swap(runs_);
  }
  runs.clear();  // the output is at zero
  reap(true);
  std::map<std::uint32_t, std::shared_ptr<daq::Device>> devices;
  {
    const std::scoped_lock lock(mutex_);
    devices.swap(devices_);
  }
  devices.clear();
  server_.reset();  // the server sees that all of it is done
}

void Host::hear() {
  bool there = server_->receive();
  try {
    while (const auto message = server_->next()) {
      heard_ = Clock::now();
      take(*message);
    }
  } catch (const Damaged&) {  // whoever speaks so is no server
    there = false;
  }
  if (!there) desert();
}

void Host::answer_later(std::uint64_t call, std::function<std::string()> act) {
  if (works_.size() >= most_works) throw Damaged("the server asks for too much at once");
  auto& work = works_.emplace_back();
  work.thread = std::thread([this, call, act = std::move(act), &work] {
    Reply reply{.call = call};
    try {
      reply.body = act();
    } catch (const std::exception& error) {
      reply.failure = Failure::of(error);
    }
    {
      const std::scoped_lock lock(mutex_);
      replies_.push_back(framed(reply));
    }
    work.done = true;
    nudge_.give();
  });
}

void Host::reap(bool wait) {
  for (auto work = works_.begin(); work != works_.end();) {
    if (!wait && !work->done) {
      ++work;
      continue;
    }
    work->thread.join();
    work = works_.erase(work);
  }
}

Host::Running& Host::running(std::uint32_t number) {
  const std::scoped_lock lock(mutex_);
  const auto found = runs_.find(number);
  if (found == runs_.end()) throw Error(ErrorCode::bad_state, "the bench has no such run");
  return found->second;
}

void Host::take(const Message& message) {
  const auto steer = [this](const auto& asked, const std::function<void(Run&)>& act) {
    Reply reply{.call = asked.call};
    try {
      auto& run = *running(asked.run).run;
      act(run);
      if (!run.over()) send(framed(Status{asked.run, run.state()}));
    } catch (const std::exception& error) {
      reply.failure = Failure::of(error);
    }
    send(framed(reply));
  };
  const auto later = [this]<class M>(M asked, std::string (Host::*act)(const M&)) {
    const auto call = asked.call;
    answer_later(call, [this, asked = std::move(asked), act] { return (this->*act)(asked); });
  };
  switch (message.kind) {
    case Kind::open:
      return later(message.as<Open>(), &Host::open);
    case Kind::close:
      return later(message.as<Close>(), &Host::close);
    case Kind::selftest:
      return later(message.as<Selftest>(), &Host::selftest);
    case Kind::prepare:
      return later(message.as<Prepare>(), &Host::prepare);
    case Kind::look: {
      const auto asked = message.as<Look>();
      return answer_later(asked.call,
                          [this, asked] { return encoded(daq::facts_of(*demand_device(asked.device))); });
    }
    case Kind::stop_selftest: {
      const auto asked = message.as<StopSelftest>();
      const std::scoped_lock lock(mutex_);
      if (tests_ > 0) test_stop_ = asked.reason;
      return;
    }
    case Kind::begin: {
      const auto asked = message.as<Begin>();
      return begin(asked, server_->take_file());
    }
    case Kind::attend: {
      const auto asked = message.as<Attend>();
      const std::scoped_lock lock(mutex_);
      if (const auto found = runs_.find(asked.run); found != runs_.end()) {
        found->second.told_closed = false;
        found->second.told_at = {};
      }
      return;
    }
    case Kind::drop: {
      const auto asked = message.as<Drop>();
      std::shared_ptr<Run> dropped;  // goes without the lock
      const std::scoped_lock lock(mutex_);
      const auto found = runs_.find(asked.run);
      if (found == runs_.end() || (found->second.run->begun() && !found->second.run->over())) return;
      dropped = std::move(found->second.run);
      runs_.erase(found);
      return;
    }
    case Kind::pause:
      return steer(message.as<Pause>(), [](Run& run) { run.pause(); });
    case Kind::resume:
      return steer(message.as<Resume>(), [](Run& run) { run.resume(); });
    case Kind::stop: {
      const auto asked = message.as<Stop>();
      return steer(asked, [&](Run& run) { run.stop(asked.reason); });
    }
    case Kind::hasten:
      return steer(message.as<Hasten>(), [](Run& run) { run.hasten(); });
    case Kind::alive:
      return send(framed(Alive{}));
    case Kind::leave:
      left_ = true;
      return;
    case Kind::ready:
    case Kind::reply:
    case Kind::status:
    case Kind::event:
    case Kind::closed:
      break;
  }
  throw Damaged("the server does not say this");
}

std::string Host::open(const Open& asked) {
  std::shared_ptr<daq::Device> opened = open_(asked.driver, asked.config);
  auto out = encoded(daq::facts_of(*opened));
  add_device(asked.device, std::move(opened));
  return out;
}

std::string Host::close(const Close& asked) {
  const auto device = demand_device(asked.device);
  {
    const std::scoped_lock lock(mutex_);
    devices_.erase(asked.device);
  }
  if (device->output() == 0) return {};
  try {
    device->go_to(0, asked.slew);
  } catch (const std::exception& failure) {
    throw Error(ErrorCode::device_lost, "the device is closed, but " + daq::not_at_zero(failure.what()));
  }
  return {};
}

std::string Host::selftest(const Selftest& asked) {
  const auto device = demand_device(asked.device);
  const auto count = [this](int change) {
    const std::scoped_lock lock(mutex_);
    tests_ += change;
    if (tests_ == 0 && served_) test_stop_.clear();
  };
  count(1);
  try {
    const auto report = daq::selftest(*device, asked.rate, [this] {
      const std::scoped_lock lock(mutex_);
      return test_stop_;
    });
    count(-1);
    return encoded(report);
  } catch (...) {
    count(-1);
    throw;
  }
}

std::string Host::prepare(const Prepare& asked) {
  auto device = demand_device(asked.device);
  auto run = std::make_shared<Run>(std::move(device), asked, [this] { nudge_.give(); });
  auto out = encoded(run->prepared());
  const std::scoped_lock lock(mutex_);
  if (asked.last_use) devices_.erase(asked.device);
  runs_[asked.run].run = std::move(run);
  return out;
}

void Host::begin(const Begin& asked, Descriptor journal) try {
  if (!journal) throw Damaged("the journal did not come with the run");
  auto& running = this->running(asked.run);
  running.unattended = asked.unattended;
  running.folder = asked.folder;
  running.card = asked.card;
  running.journal = journal.duplicate();
  running.run->begin(asked, std::move(journal), process_);
} catch (const Error& failure) {  // a server that knows what it says gives no cause for it
  throw Damaged(failure.what());
}

// What the server has not heard yet, as far as it takes it.
void Host::tell() {
  if (!server_) return;
  std::vector<std::string> replies;
  {
    const std::scoped_lock lock(mutex_);
    replies.swap(replies_);
    for (auto& [number, running] : runs_) tell_of(number, running);
  }
  for (auto& reply : replies) send(std::move(reply));
  if (!server_->flush()) desert();
}

void Host::tell_of(std::uint32_t number, Running& running) {
  auto& run = *running.run;
  if (!run.begun() || running.told_closed || server_->bytes_queued() > most_queued) return;
  const auto closed = run.closed();  // first: no event comes after it
  std::uint64_t missed = 0;
  for (auto& event : run.take_events(missed))
    send(framed(Noted{.run = number, .missed = std::exchange(missed, 0), .event = std::move(event)}));
  if (closed) {
    auto last = *closed;
    last.run = number;
    send(framed(last));
    running.told_closed = true;
    return;
  }
  const auto state = run.state();
  if (same(state, running.told) && Clock::now() - running.told_at < status_interval) return;
  send(framed(Status{.run = number, .state = state}));
  running.told = state;
  running.told_at = Clock::now();
}

void Host::watch_server() {
  const bool silent = server_ && process_ && Clock::now() - heard_ > silence_allowed;
  if (silent == unheard_) return;
  unheard_ = silent;
  if (!silent) return;
  const std::scoped_lock lock(mutex_);
  for (auto& [number, running] : runs_)
    if (!running.unattended) running.run->stop(server_silent);
}

// The server has ended, however it did.
void Host::desert() {
  server_.reset();
  std::map<std::uint32_t, std::shared_ptr<daq::Device>> devices;
  std::string folder;
  {
    const std::scoped_lock lock(mutex_);
    served_ = false;
    replies_.clear();
    test_stop_ = server_ended;
    devices.swap(devices_);
    for (auto& [number, running] : runs_) {
      if (!running.unattended) running.run->stop(server_ended);
      running.told_closed = false;
      running.told = {};
      if (running.run->begun() && !running.folder.empty()) folder = running.folder;
    }
    std::erase_if(runs_, [](const auto& entry) { return !entry.second.run->begun(); });
  }
  if (!process_ || folder.empty()) return;
  door_path_ =
      folder + '/' + std::string(socket_prefix) + std::to_string(getpid()) + std::string(socket_suffix);
  try {
    door_ = Descriptor(listen_unix(door_path_));
  } catch (const Error&) {  // nobody can come then
  }
}

void Host::take_over() {
  Descriptor next(accept4(door_.get(), nullptr, nullptr, SOCK_CLOEXEC));
  if (!next || !is_trusted_peer(next.get())) return;
  door_ = {};
  unlink(door_path_.c_str());
  server_.emplace(std::move(next));
  heard_ = Clock::now();
  over_since_.reset();
  Ready ready{.process = getpid(), .lacks = lacks_};
  Descriptor journal;
  const std::scoped_lock lock(mutex_);
  served_ = true;
  test_stop_.clear();
  for (const auto& [number, running] : runs_)
    if (!running.card.empty()) {
      ready.run = number;
      ready.card = running.card;
      journal = running.journal.duplicate();
    }
  server_->send(framed(ready), std::move(journal));
}

// A process without a server ends when nothing is left to do and nobody has come.
bool Host::finished() {
  if (left_) return true;
  if (server_) return false;
  if (!process_) return true;
  {
    const std::scoped_lock lock(mutex_);
    for (const auto& [number, running] : runs_)
      if (running.run->begun() && !running.run->over()) return false;
  }
  if (!door_) return true;
  if (!over_since_) over_since_ = Clock::now();
  return Clock::now() - *over_since_ >= wait_for_next;
}

}  // namespace ferrobench::bench
