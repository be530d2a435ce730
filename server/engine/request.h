// What a client asks for when it starts a run, and the plan that comes of it.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/fields.h"
#include "daq/device_facts.h"
#include "daq/replay/replay_source.h"
#include "protocols/protocol.h"
#include "recordings/disk/new_file.h"
#include "recordings/format/parts.h"
#include "server/engine/store.h"

namespace ferrobench::server {

struct RunRequest {
  nlohmann::json protocol{};       // name of one that ships or was put here, or a protocol
  std::string device = "virtual";  // a kind, opened for this run alone, or a device opened before
  nlohmann::json config{};         // of the device, where it is opened for this run
  nlohmann::json model{};          // name or model; virtual device only
  bool fast = false;
  std::int64_t seed = 1;
  nlohmann::json set = nlohmann::json::object();
  std::string notes{};
  std::string rerun_of{};
  std::string idempotency_key{};
  // For the command line alone, as no method takes a path: the file of a replay; "": the store's recording
  // that the device names. What becomes of a file that is where the recording is to go.
  std::string replay_file{};
  recordings::Existing existing = recordings::Existing::keep;
  // For the queue alone: the id that the run is to have, "" for a new one; and what is asked when a stop
  // would reach the run from then on: throws if it must not start.
  std::string id{};
  std::function<void()> last_word{};
  // Likewise, by a thread of the run: sees all that is measured; and says why the run must end, or "".
  std::function<void(const recordings::Rows&)> watch{};
  std::function<std::string()> stop_wanted{};
};
template <class Visitor>
void describe(Visitor& visit, RunRequest& r) {
  visit("protocol", r.protocol,
        {.doc = "name of a protocol that ships or was put here, or a protocol; none for a replay, which has "
                "its own"});
  visit("device", r.device,
        {.doc = "a kind of device (opened for this run alone), one opened before, or \"replay:NAME\" of a "
                "recording"});
  visit("config", r.config, {.doc = "of a device that is opened for this run, as device.list describes it"});
  visit("model", r.model, {.doc = "name of a model, or a model; for the virtual device"});
  visit("fast", r.fast, {.doc = "virtual device and replay: as fast as it can go, not in real time"});
  visit("seed", r.seed, {.min = 0, .doc = "virtual device: of the noise; same seed, same bytes"});
  visit("set", r.set,
        {.doc = "values by key: parameters of the protocol, prestress_Pa, prestress_MPa, "
                "spring_stiffness_N_per_m, sample_rate_Hz, model.<path>, device.<path>"});
  visit("notes", r.notes, {.doc = "kept in the recording"});
  visit("rerun_of", r.rerun_of, {.doc = "identifier of the recording that this run repeats; kept in it"});
  visit("idempotency_key", r.idempotency_key,
        {.doc = "a second start with the same key returns the first one's run"});
}

struct RunPlan {
  protocols::Protocol protocol{};  // as executed; none for a replay
  std::string name{}, title{};
  double sample_rate = 0;          // Hz, asked for
  nlohmann::json device_config{};  // to open it with; null if the device is open already
  nlohmann::json model{};          // with the load in force; null if the device has none
};

// `open`: what the device named by the request says if it was opened before, else null. Its model and load
// are what they are; a fresh virtual device takes the load set, else the protocol's, else the model's. Throws
// Error(invalid_params) with what is allowed for a key that is not, and what reading the protocol and model
// throws.
RunPlan make_plan(const RunRequest& request, const Store& store, const daq::DeviceFacts* open = nullptr);

// The name in "replay:NAME"; none for another device.
std::optional<std::string> replayed(const std::string& device);
// The plan of a replay, whose device is opened by it: `file` is the recording, and `set` has the device's
// configuration by "device.<path>". Throws Error(invalid_params).
RunPlan make_replay_plan(const RunRequest& request, const std::string& file);
// What its recording says of it: name, title, sample rate.
void complete_replay_plan(RunPlan& plan, const daq::ReplaySource& source);
// The plan of a run of a replay that is open.
RunPlan make_replay_plan(const RunRequest& request, const daq::ReplaySource& source);

// A protocol by name or as JSON, of the store where there is one; a model by name or as JSON (null: the
// default one), with everything filled in.
protocols::Protocol resolve_protocol(const nlohmann::json& given, const Store* store = nullptr);
nlohmann::json resolve_model(const nlohmann::json& given, const Store& store);

}  // namespace ferrobench::server
