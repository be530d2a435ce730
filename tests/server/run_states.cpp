#include "tests/server/run_states.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <fstream>
#include <random>
#include <thread>

#include "recordings/file/reader.h"
#include "server/methods/methods.h"
#include "tests/server/engine_bench.h"

namespace ferrobench::server::states {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

namespace {

// What the clients know of the bench, each from the others.
class Board {
 public:
  void add(std::deque<std::string>& list, const std::string& name) {
    const std::scoped_lock lock(mutex_);
    list.push_back(name);
  }
  void remove(std::deque<std::string>& list, const std::string& name) {
    const std::scoped_lock lock(mutex_);
    std::erase(list, name);
  }
  // The newest but `back`, "" if there are not as many.
  std::string newest(const std::deque<std::string>& list, std::size_t back) const {
    const std::scoped_lock lock(mutex_);
    return back < list.size() ? list[list.size() - 1 - back] : "";
  }
  std::size_t size(const std::deque<std::string>& list) const {
    const std::scoped_lock lock(mutex_);
    return list.size();
  }

  std::deque<std::string> runs, recordings, devices, keys;

 private:
  mutable std::mutex mutex_;
};

// As slow as hardware may be, so that calls come while a run is being prepared.
std::unique_ptr<daq::Device> open_slowly(const std::string& kind, const json& config) {
  static std::atomic<unsigned> number{0};
  usleep(1000 * (7 * ++number % 30));
  return daq::open_device(kind, config);
}

struct Bench {
  Folder folder{};
  Hub hub{};
  Engine engine;
  Dispatcher rpc{};
  Board board{};
  Clock::time_point begin = Clock::now();

  explicit Bench(bool process) : engine(folder.path, hub, process ? DeviceOpener{} : open_slowly) {
    add_all_methods(rpc, engine);
  }
  double now() const { return std::chrono::duration<double>(Clock::now() - begin).count(); }
};

class Client {
 public:
  Client(Bench& bench, int number, std::uint64_t seed)
      : bench_(bench), number_(number), random_(seed * 1000 + static_cast<std::uint64_t>(number)) {
    connect();
  }

  void work(std::size_t steps) {
    while (asks.size() < steps) {
      step();
      if (below(2) == 0) usleep(static_cast<useconds_t>(below(6000)));
    }
  }

  std::vector<Ask> asks;

 private:
  int below(int count) { return std::uniform_int_distribution(0, count - 1)(random_); }
  double between(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }

  void connect() { caller_ = {.client = "client " + std::to_string(number_), .lease = "", .subscriber = {}}; }

  const Ask& ask(const std::string& method, json params) {
    Ask out{.client = number_, .method = method, .params = std::move(params), .lease = caller_.lease};
    const json request{{"jsonrpc", "2.0"}, {"method", method}, {"params", out.params}, {"id", asks.size()}};
    out.begin = bench_.now();
    const auto reply = json::parse(bench_.rpc.handle(request.dump(), caller_).value());
    out.end = bench_.now();
    if (reply.contains("error"))
      out.error = reply["error"]["data"].value("name", "nameless");
    else
      out.result = reply["result"];
    asks.push_back(std::move(out));
    return asks.back();
  }

  std::string some_run() {
    const int choice = below(20);
    if (choice == 0) return "no such run";
    if (choice < 8) return "";
    return bench_.board.newest(bench_.board.runs, choice == 8 ? static_cast<std::size_t>(below(50)) : 0);
  }

  // Up, a hold, and down; one in three begins away from zero, so that there is a way to its first level.
  json program() {
    const double start = below(3) == 0 ? between(0.01, 0.08) : 0, ramp = between(0.01, 0.05);
    return {{"format", "ferrobench-protocol"},
            {"version", 1},
            {"name", "random"},
            {"title", "Random"},
            {"unit", "kV/mm"},
            {"start", start},
            {"segments",
             {{{"kind", "ramp"}, {"to", between(-0.1, 0.5)}, {"time", ramp}},
              {{"kind", "hold"}, {"time", between(0.01, 0.3)}},
              {{"kind", "ramp"}, {"to", 0}, {"time", ramp}}}}};
  }

  void start() {
    json params{{"protocol", program()},
                {"set", {{"sample_rate_Hz", std::pow(10, between(2.3, 4))}, {"device.domains", 16}}},
                {"fast", below(4) == 0}};
    const auto device = bench_.board.newest(bench_.board.devices, static_cast<std::size_t>(below(3)));
    switch (below(10)) {
      case 0:
        params["protocol"] = "no such protocol";
        break;
      case 1:
        params["protocol"]["segments"][0]["to"] = 1.8;  // past the limits
        break;
      case 2:
        params["set"]["no such setting"] = 1;
        break;
      case 3:
      case 4:
        if (device.empty()) break;
        params["device"] = device;
        params["set"].erase("device.domains");
        params.erase("fast");
        break;
      case 5:
        params["idempotency_key"] = std::to_string(number_) + "." + std::to_string(asks.size());
        break;
      case 6:
        again();
        return;
      default:
        break;
    }
    started(ask("run.start", std::move(params)));
  }

  // What somebody had started by a key, once more; now and then with the key for another request.
  void again() {
    const auto text = bench_.board.newest(bench_.board.keys, static_cast<std::size_t>(below(20)));
    if (text.empty()) return;
    auto params = json::parse(text);
    if (below(5) == 0) params["notes"] = "another";
    started(ask("run.start", std::move(params)));
  }

  void started(const Ask& ask) {
    if (!ask.error.empty()) return;
    bench_.board.add(bench_.board.runs, ask.result.at("run"));
    if (ask.params.contains("idempotency_key")) bench_.board.add(bench_.board.keys, ask.params.dump());
  }

  void replay() {
    const auto name = bench_.board.newest(bench_.board.recordings, static_cast<std::size_t>(below(8)));
    json params{{"recording", name.empty() ? "nothing" : name}};
    if (below(2) == 0) params["fast"] = true;
    if (below(10) == 0) params["speed"] = 0.5;  // must be 1 or more
    started(ask("replay.start", std::move(params)));
  }

  void open() {
    if (bench_.board.size(bench_.board.devices) > 2) return;
    const json config{{"clock", below(2) == 0 ? "fast" : "real"}, {"domains", 16}};
    const auto& opened = ask("device.open", {{"device", "virtual"}, {"config", config}});
    if (opened.error.empty()) bench_.board.add(bench_.board.devices, opened.result.at("device"));
  }

  void close() {
    const auto device = bench_.board.newest(bench_.board.devices, 0);
    if (ask("device.close", {{"device", device}}).error.empty())
      bench_.board.remove(bench_.board.devices, device);
  }

  void lease() {
    switch (below(12)) {
      case 0:
        ask("lease.acquire", {{"duration_s", between(1, 1.5)}});
        break;
      case 2:
        ask("lease.renew", {{"duration_s", between(1, 1.5)}});
        break;
      case 3: {  // the connection breaks; the next one may still know the lease
        const auto old = caller_.lease;
        if (!old.empty() && below(8) != 0) break;
        connect();
        if (below(2) == 0 && !old.empty()) ask("lease.renew", {{"lease", old}, {"duration_s", 1}});
        break;
      }
      case 4:
        ask("lease.release", json::object());
        break;
      default:
        ask("lease.status", json::object());
    }
  }

  // A lease is not kept for long, or there would be little but refusals.
  void step() {
    const int choice = below(100);
    if (!caller_.lease.empty() && below(6) == 0) {
      ask("lease.release", json::object());
    } else if (choice < 18) {
      start();
    } else if (choice < 23) {
      replay();
    } else if (choice < 38) {
      ask("run.pause", {{"run", some_run()}});
    } else if (choice < 43) {
      ask("run.resume", {{"run", some_run()}});
    } else if (choice < 44) {
      ask("run.abort", {{"run", below(2) == 0 ? "" : some_run()}, {"reason", "enough"}});
      if (below(2) == 0) ask("run.abort", {{"run", ""}, {"reason", "faster"}});
    } else if (choice < 45) {
      if (below(3) != 0) return;
      ask("job.cancel", {{"job", some_run()}});
    } else if (choice < 72) {
      ask("run.status", {{"run", some_run()}});
    } else if (choice < 74) {
      ask("run.list", json::object());
    } else if (choice < 78) {
      ask("limits.set", {{"field_max", below(4) == 0 ? -1 : below(4) == 0 ? 0.3e6 : 1.6e6}});
    } else if (choice < 80) {
      ask("limits.get", json::object());
    } else if (choice < 92) {
      lease();
    } else if (choice < 94) {
      open();
    } else if (choice < 95) {
      close();
    } else if (choice < 97) {
      const auto device = bench_.board.newest(bench_.board.devices, 0);
      ask("device.info", {{"device", device}});
    } else if (choice < 99) {
      ask("job.status", {{"job", some_run()}});
    } else {
      ask("run.start", {{"no such parameter", 1}});
    }
  }

  Bench& bench_;
  int number_;
  std::mt19937_64 random_;
  CallContext caller_;
};

// The bench processes that this program has started and that live.
std::vector<pid_t> bench_processes() {
  std::vector<pid_t> out;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const auto process = static_cast<pid_t>(std::strtol(entry.path().filename().c_str(), nullptr, 10));
    if (process <= 0) continue;
    std::string name, word;
    std::getline(std::ifstream(entry.path() / "cmdline"), name, '\0');
    std::ifstream stat(entry.path() / "stat");
    for (int i = 0; i < 4; ++i) stat >> word;  // number, name without a space, state, parent
    if (name.starts_with("ferrobench: holds") && word == std::to_string(getpid())) out.push_back(process);
  }
  return out;
}

// Kills the bench at any moment until `enough`.
std::vector<Ask> kill_benches(const Bench& bench, int client, std::uint64_t seed,
                              const std::atomic<bool>& enough) {
  std::mt19937_64 random(seed);
  std::vector<Ask> out;
  while (!enough) {
    usleep(std::uniform_int_distribution<useconds_t>(0, 900'000)(random));
    for (const auto process : bench_processes()) {
      Ask death{.client = client, .method = std::string(bench_death), .begin = bench.now()};
      kill(process, SIGKILL);
      death.end = bench.now();
      out.push_back(std::move(death));
    }
  }
  return out;
}

// Sees all that the topic "run" tells, and looks at what each run left.
class Observer {
 public:
  explicit Observer(Bench& bench) : bench_(bench) {
    constexpr OutboxLimits no_end{.messages = 1u << 30, .bytes = std::size_t{1} << 40};
    subscriber_ = std::make_shared<Subscriber>(no_end, [this] { wake(); });
    bench.hub.subscribe("run", subscriber_, std::nullopt);
    listener_ = std::thread([this] { listen(); });
  }
  ~Observer() { end(); }

  void end() {
    {
      const std::scoped_lock lock(mutex_);
      ending_ = woken_ = true;
    }
    changed_.notify_one();
    if (listener_.joinable()) listener_.join();
    subscriber_->close();
  }

  std::vector<Told> told;
  std::vector<std::string> failures;

 private:
  void wake() {
    const std::scoped_lock lock(mutex_);
    woken_ = true;
    changed_.notify_one();
  }

  void listen() {
    for (bool more = true; more;) {
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return woken_; });
        woken_ = false;
        more = !ending_;
      }
      while (const auto text = subscriber_->next()) {
        const auto message = json::parse(*text);
        Told next{.time = bench_.now()};
        std::vector<Problem> problems;
        read_json(message.at("params"), next.status, "", problems);
        if (message.at("method") != "run" || !problems.empty()) failures.push_back("told: " + *text);
        const bool again = !told.empty() && told.back().status.run == next.status.run &&
                           told.back().status.state == next.status.state;
        told.push_back(std::move(next));
        if (!again && is_over(told.back().status.state)) look_at(told.back().status);
      }
    }
  }

  void look_at(const RunStatus& run) {
    for (const auto& id : bench_.engine.open_devices()) {
      try {
        bench_.engine.with_device(id, [&](const daq::DeviceFacts& device) {
          if (device.output != 0) failures.push_back(id + " has a voltage at its output and no run");
        });
      } catch (const Error&) {  // has a run, or was closed
      }
    }
    if (run.path.empty()) return;
    try {
      const auto r = recordings::read_recording(run.path);
      const auto& command = r.at(recordings::Channel::command);
      const auto fail = [&](const std::string& what) {
        failures.push_back(run.run + " " + what + "; its file: " + r.status + ", " + r.reason +
                           "; its status: " + write_json(run).dump());
      };
      if (!command.empty() && command.back() != 0 && r.status != "recovered")
        fail("was recorded until " + json(command.back()).dump());
      if (static_cast<std::int64_t>(r.size()) != run.rows)
        fail("has " + std::to_string(r.size()) + " rows in its file");
    } catch (const std::exception& error) {
      failures.push_back(run.run + ": " + error.what());
    }
    auto& board = bench_.board;
    board.add(board.recordings, run.recording);
    if (const auto old = board.newest(board.recordings, 10); !old.empty()) {
      board.remove(board.recordings, old);
      std::filesystem::remove(bench_.engine.store().recordings() / (old + ".h5"));
    }
  }

  Bench& bench_;
  std::shared_ptr<Subscriber> subscriber_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool woken_ = false, ending_ = false;
  std::thread listener_;
};

}  // namespace

Figures play(std::size_t steps, int clients, std::uint64_t seed, bool deaths) {
  Bench bench(deaths);
  Observer observer(bench);
  std::deque<Client> all;
  for (int i = 0; i < clients; ++i) all.emplace_back(bench, i, seed);
  std::vector<Ask> asks;
  {
    std::atomic<bool> enough = false;
    std::jthread killer;
    if (deaths) killer = std::jthread([&] { asks = kill_benches(bench, clients + 1, seed, enough); });
    {
      std::vector<std::jthread> threads;
      for (auto& client : all)
        threads.emplace_back([&] { client.work(steps / static_cast<std::size_t>(clients)); });
    }
    enough = true;
  }
  for (auto& client : all) std::ranges::move(client.asks, std::back_inserter(asks));
  // The last run is stopped by one who has no lease.
  CallContext stranger{.client = "stranger", .lease = "", .subscriber = {}};
  Ask last{.client = clients, .method = "run.abort", .params = {{"run", ""}}, .begin = bench.now()};
  try {
    last.result = bench.rpc.call("run.abort", json::object(), stranger);
  } catch (const Error& error) {
    last.error = entry(error.code()).name;
  }
  last.end = bench.now();
  asks.push_back(std::move(last));
  bench.engine.stop();
  observer.end();
  Figures figures{.steps = asks.size(), .failures = std::move(observer.failures)};
  judge(asks, observer.told, figures);
  return figures;
}

}  // namespace ferrobench::server::states
