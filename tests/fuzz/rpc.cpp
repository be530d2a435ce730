// Any text as a request: the reply is none, or JSON-RPC 2.0. Methods that start something (a run, a job, a
// device) are left out: they would outlive the text.
#include <spdlog/spdlog.h>

#include "input.h"
#include "server/methods/methods.h"
#include "server/rpc/discover.h"
#include "server/rpc/subscribe.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

struct Bench {
  Hub hub{};
  Engine engine{fuzz::folder(), hub};
  Dispatcher rpc{};
  Bench() {
    spdlog::set_level(spdlog::level::off);
    add_system_methods(rpc, engine);
    add_protocol_methods(rpc, engine);
    add_recording_methods(rpc, engine);
    add_subscription_methods(rpc, hub);
    add_discovery(rpc, hub, "0");
    rpc.set_gate(
        [this](const Method& method, const CallContext& caller) { engine.lease().demand(method, caller); });
  }
};

void demand_reply(const json& reply) {
  fuzz::demand(reply.is_object() && reply.value("jsonrpc", "") == "2.0" && reply.contains("id") &&
                   reply.contains("result") != reply.contains("error"),
               "a reply");
  if (!reply.contains("error")) return;
  const auto& error = reply["error"];
  fuzz::demand(error["code"].is_number_integer() && error["message"].is_string(), "an error");
  fuzz::demand(error["code"] != -32603, "an error that somebody thought of");
}

}  // namespace
}  // namespace ferrobench::server

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ferrobench;
  using namespace ferrobench::server;
  static Bench bench;
  CallContext caller{
      .client = "fuzz", .lease = "", .subscriber = std::make_shared<Subscriber>(OutboxLimits{}, nullptr)};
  if (const auto reply = bench.rpc.handle(fuzz::text_of(data, size), caller)) {
    const auto parsed = nlohmann::json::parse(*reply);
    if (parsed.is_array()) {
      for (const auto& one : parsed) demand_reply(one);
    } else {
      demand_reply(parsed);
    }
  }
  bench.hub.remove(*caller.subscriber);
  if (!bench.engine.lease().status().holder.empty()) bench.engine.lease().release(caller, "");
  return 0;
}
