// The bench that a subcommand talks to: the daemon if one runs, else an engine in this process. Both take the
// same methods.
#pragma once

#include <memory>
#include <optional>

#include "recordings/disk/new_file.h"
#include "server/cli/cli.h"
#include "server/engine/engine.h"
#include "server/net/client.h"
#include "server/rpc/dispatcher.h"

namespace ferrobench::cli {

class Link {
 public:
  explicit Link(const Common& common);
  bool is_daemon() const { return client_.has_value(); }
  // Throws Error, whichever side it comes from.
  nlohmann::json call(const std::string& method, const nlohmann::json& params = nlohmann::json::object());
  // Only without a daemon: the engine itself, for what no method can say (a recording's path).
  server::Engine& engine() { return *engine_; }

 private:
  std::optional<server::Client> client_;
  server::Hub hub_;
  std::unique_ptr<server::Engine> engine_;
  server::Dispatcher rpc_;
  server::CallContext context_{.client = "command line", .lease = "", .subscriber = nullptr};
};

// The daemon, where one runs; it has been shown the lease.
std::optional<server::Client> running_daemon(const Common& common);

// Long work of the daemon: starts the job that `method` is, shows how far it is, and cancels it on Ctrl-C.
// The last status: complete, or cancelled with whatever result there is. What failed is thrown.
nlohmann::json carry_out_job(server::Client& daemon, const std::string& method, const nlohmann::json& params);

// Starts a run (parameters of run.start), follows it, and sees to it that the recording lies in `out`, if not
// "". Returns the last status, with "interrupted".
nlohmann::json carry_out(Link& link, const nlohmann::json& params, const std::string& out,
                         recordings::Existing existing, bool quiet, const Common& common);

}  // namespace ferrobench::cli
