#include <sys/stat.h>
#include <unistd.h>

#include <iostream>
#include <thread>

#include "recordings/recover.h"
#include "server/cli/link.h"
#include "server/methods/methods.h"
#include "server/net/server.h"
#include "server/net/token.h"
#include "server/web/page.h"

namespace ferrobench::cli {

namespace fs = std::filesystem;

namespace {

struct ServeOptions {
  server::ServerOptions net;
  std::string token_file{};
};

// What the runs of a program that died have left. One that cannot be made whole stays for 'ferrobench
// recover'.
void recover_all(const std::string& folder) {
  for (const auto& path : recordings::find_broken(folder)) {
    const auto name = fs::path(path).filename().string();
    try {
      const auto done = recordings::recover_recording(path);
      std::cout << recovered_name(done.outcome) << ' ' << name << ": " << done.message << std::endl;
    } catch (const Error& error) {
      std::cerr << "ferrobench: " << name << " cannot be recovered: " << error.what() << std::endl;
    }
  }
}

int serve(const ServeOptions& o, const Common& common) {
  const Interrupt interrupt;
  server::Hub hub;
  server::Engine engine(common.data_folder(), hub);
  server::Dispatcher rpc;
  add_all_methods(rpc, engine);
  recover_all(engine.store().recordings().string());

  auto options = o.net;
  options.unix_socket = common.socket_path();
  const fs::path token_file =
      o.token_file.empty() ? server::state_folder() / "token" : fs::path(o.token_file);
  options.token = server::load_or_create_token(token_file);
  server::Content content{
      .asset = server::page_asset,
      .recording = [&engine](const std::string& name) { return engine.store().download(name); },
      .disconnected = nullptr};
  server::Server door(rpc, hub, options, std::move(content));

  const auto address = "http://" + options.address + ":" + std::to_string(door.port());
  std::cout << "ferrobench is listening\n"
            << "  page      " << address << "/?token=" << options.token << '\n'
            << "  JSON-RPC  " << address << "/rpc (token in " << token_file.string() << ")\n"
            << "  socket    " << options.unix_socket << '\n'
            << "  data      " << engine.store().folder().string() << '\n'
            << "Ctrl-C stops it; a run under way is stopped safely first." << std::endl;
  while (Interrupt::count() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  std::cout << "stopping" << std::endl;
  engine.stop();
  door.stop();
  return exit_ok;
}

}  // namespace

void add_serve(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("serve", "Start the daemon: JSON-RPC, the page, and one bench");
  auto o = std::make_shared<ServeOptions>();
  sub->add_option("--port", o->net.port, "TCP port; 0: any free one")->capture_default_str();
  sub->add_option("--address", o->net.address, "numeric address to listen at")->capture_default_str();
  sub->add_flag("--allow-remote", o->net.allow_remote,
                "allow an address other than loopback (no TLS: use a tunnel)");
  sub->add_option("--host", o->net.extra_hosts, "a name that other machines reach it by; again for more")
      ->type_name("NAME")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--token-file", o->token_file,
                  "the secret that HTTP clients show; made at the first start, mode 0600; default: "
                  "~/.local/state/ferrobench/token")
      ->type_name("FILE");
  sub->footer(
      "Recordings whose run broke off are made whole before it listens (ferrobench recover --help).\n"
      "Examples:\n"
      "  ferrobench serve\n"
      "  ferrobench serve --port 0 --data /tmp/bench");
  sub->callback([o, &common] { common.action = [o, &common] { return serve(*o, common); }; });
}

}  // namespace ferrobench::cli
