#include <sys/resource.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <iostream>
#include <thread>

#include "recordings/hdf5/read_apart.h"
#include "recordings/process/child.h"
#include "server/cli/deadline.h"
#include "server/cli/link.h"
#include "server/cli/words.h"
#include "server/engine/aftermath.h"
#include "server/methods/methods.h"
#include "server/methods/metrics.h"
#include "server/net/audit.h"
#include "server/net/server.h"
#include "server/net/token.h"
#include "server/queue/queue.h"
#include "server/web/page.h"

namespace ferrobench::cli {

namespace fs = std::filesystem;

namespace {

struct ServeOptions {
  server::ServerOptions net;
  std::string token_file{};
  std::vector<std::string> hooks{};
};

// The page's address opens the bench to whoever has it. A terminal shows it to its user alone; a file or a
// journal is told where the token is.
std::string page_address(const std::string& address, const std::string& token, const fs::path& token_file) {
  if (isatty(STDOUT_FILENO) != 0) return address + "/?token=" + token;
  return address + "/?token=TOKEN (TOKEN is the text of " + token_file.string() + ")";
}

// systemd, where it started the daemon, is told that it lives as long as engine and door answer. Elsewhere
// nobody is.
void wait_for_interrupt(const server::Engine& engine, const server::Server& door) {
  using Clock = std::chrono::steady_clock;
  std::uint64_t patience = 0;  // of the watchdog, in us
  const bool watched = sd_watchdog_enabled(0, &patience) > 0;
  const std::chrono::microseconds interval(patience / 4);
  auto next = Clock::now();
  sd_notify(0, "READY=1");
  while (Interrupt::count() == 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    if (!watched || Clock::now() < next) continue;
    next = Clock::now() + interval;
    engine.status();  // takes the locks of bench and run
    if (door.answers(std::chrono::duration_cast<std::chrono::milliseconds>(interval)))
      sd_notify(0, "WATCHDOG=1");
  }
  sd_notify(0, "STOPPING=1");
}

// As many as the system lets it have, for clients, recordings and children.
void allow_descriptors() {
  constexpr rlim_t plenty = 4096;
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) != 0 || files.rlim_cur >= plenty) return;
  files.rlim_cur = std::min(plenty, files.rlim_max);
  setrlimit(RLIMIT_NOFILE, &files);
}

constexpr std::chrono::seconds after_stop{60};

std::string what_the_run_waits_for(const server::Engine& engine) {
  return std::string("the run's ") +
         (engine.output_at_zero() ? "file; the output is at zero"
                                  : "device: the output may not be at zero, switch the amplifier off") +
         "; the next start makes the recording's file of its journal";
}

int serve(const ServeOptions& o, const Common& common) {
  const Interrupt interrupt;
  allow_descriptors();
  // Four jobs, two views and a replay may read at once, and a run needs its memory.
  recordings::allow_each_recording(1.0 / 8);
  std::optional<Deadline> deadline;  // outlives the engine, whose jobs may take their time to end
  std::atomic<bool> run_over = false;
  server::Hub hub;
  server::Engine engine(common.data_folder(), hub);
  server::Dispatcher rpc;
  const auto queue = std::make_shared<server::Queue>(
      engine, std::make_unique<server::Hooks>(o.hooks, [](const std::string& failure) {
        std::cerr << "ferrobench: " << failure << std::endl;
      }));
  add_all_methods(rpc, engine, queue);
  try {
    if (const auto found = engine.take_over(); !found.empty()) std::cout << found << std::endl;
  } catch (const std::exception& failure) {
    std::cerr << "ferrobench: a bench process has lost its server, and its run is not taken over: "
              << failure.what() << std::endl;
  }
  if (const auto lacks = engine.start_bench(); !lacks.empty())
    std::cerr << "ferrobench: the bench process may be late where the machine is busy: " << lacks
              << std::endl;
  server::put_right(engine.store().folder().string(),
                    [&engine](bool failed, const std::string& text, const std::string& unit) {
                      if (failed)
                        std::cerr << "ferrobench: " << text << std::endl;
                      else
                        std::cout << text << std::endl;
                      if (!unit.empty()) engine.hazards().add(unit, text);
                    });
  try {
    if (const auto found = queue->open(); !found.empty()) std::cout << found << std::endl;
  } catch (const Error& failure) {
    std::cerr << "ferrobench: there is no queue: " << failure.what() << std::endl;
  }

  auto options = o.net;
  options.unix_socket = common.socket_path();
  const fs::path token_file =
      o.token_file.empty() ? server::state_folder() / "token" : fs::path(o.token_file);
  options.token = server::load_or_create_token(token_file);
  const auto audit_folder = engine.store().folder() / "audit";
  server::Audit audit(audit_folder, options.token);
  server::Metrics metrics(engine);
  rpc.set_observer([&audit, &metrics](const server::Call& call) {
    audit.call(call);
    metrics.call(call);
  });
  server::Content content{
      .asset = server::page_asset,
      .recording = [&engine](const std::string& name) { return engine.store().download(name); },
      .disconnected = nullptr,
      .refused =
          [&audit, &metrics](std::string_view client, std::string_view request,
                             const server::Refusal& refusal) {
            audit.refusal(client, request, refusal);
            metrics.refusal(refusal);
          },
      .metrics = [&audit, &metrics](const server::Load& load) { return metrics.text(load, audit.lost()); }};
  server::Server door(rpc, hub, options, std::move(content));

  const auto address = options.origin(door.port());
  std::cout << "ferrobench is listening\n"
            << "  page      " << page_address(address, options.token, token_file) << '\n'
            << "  JSON-RPC  " << address << "/rpc (token in " << token_file.string() << ")\n"
            << "  socket    " << options.unix_socket << '\n'
            << "  metrics   " << address << "/metrics (with the token, for Prometheus)\n"
            << "  data      " << engine.store().folder().string() << '\n'
            << "  audit     " << audit_folder.string() << '\n'
            << "Ctrl-C stops it; a run under way is stopped safely first, faster with a second Ctrl-C."
            << std::endl;
  wait_for_interrupt(engine, door);
  std::cout << "stopping" << std::endl;
  // The way to zero has its time in any case; the rest is for the recording's file and for replies.
  const auto most =
      std::chrono::ceil<std::chrono::seconds>(std::chrono::duration<double>(engine.limits().stop_time)) +
      after_stop;
  deadline.emplace(most, [&, most] {
    const auto waited = "ended after " + std::to_string(most.count()) + " s of waiting for ";
    return waited + (run_over ? "views and jobs" : what_the_run_waits_for(engine));
  });
  recordings::end_all_children();
  queue->close();
  auto stopped = std::async(std::launch::async, [&engine] { engine.stop(); });
  for (int told = Interrupt::count();
       stopped.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready;)
    if (std::exchange(told, Interrupt::count()) != Interrupt::count()) engine.hasten();
  stopped.get();
  run_over = true;
  queue->end();
  door.stop();
  return exit_ok;
}

}  // namespace

void add_serve(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("serve", "Start the daemon: JSON-RPC, the page, and one bench");
  auto o = std::make_shared<ServeOptions>();
  sub->add_option("--port", o->net.port, "TCP port; 0: any free one")
      ->check(number_from(0, 65535))
      ->capture_default_str();
  sub->add_option("--address", o->net.address, "numeric address to listen at")->capture_default_str();
  sub->add_option("--tls-certificate", o->net.tls_certificate,
                  "PEM file of the daemon's certificate; needed beyond loopback")
      ->type_name("FILE");
  sub->add_option("--tls-key", o->net.tls_key, "PEM file of its key")->type_name("FILE");
  sub->add_option("--host", o->net.extra_hosts, "a name that other machines reach it by; again for more")
      ->type_name("NAME")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--token-file", o->token_file,
                  "the secret that HTTP clients show; made at the first start, mode 0600; default: "
                  "~/.local/state/ferrobench/token")
      ->type_name("FILE");
  sub->add_option(
         "--on", o->hooks,
         "a program that is told, as PROGRAM EVENT JSON, of run_ended, limit_tripped, queue_empty or "
         "queue_stopped, or an address (https://...) that gets it by POST; again for more")
      ->type_name("EVENT=PROGRAM")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->footer(
      "SIGTERM or Ctrl-C bring the output to zero within the limits' stop_time, usually 10 s; a second one\n"
      "hastens it. A minute after that it ends, whatever still hangs, and the next start makes the file.\n"
      "What a crash has left is put right before it listens: outputs of hardware are brought to zero, and\n"
      "recordings are made whole (ferrobench recover --help).\n"
      "Who did what, and who was refused, stands in the folder \"audit\" of the data folder: calls.jsonl "
      "and\n"
      "refusals.jsonl, a line of JSON each, at most 80 MiB of either. GET /metrics is for Prometheus.\n"
      "Examples:\n"
      "  ferrobench serve\n"
      "  ferrobench serve --port 0 --data /tmp/bench\n"
      "  ferrobench serve --on queue_stopped=/usr/local/bin/wake-me\n"
      "  ferrobench serve --address 0.0.0.0 --host bench.lab --tls-certificate bench.pem --tls-key "
      "bench.key");
  sub->callback([o, &common] { common.action = [o, &common] { return serve(*o, common); }; });
}

}  // namespace ferrobench::cli
