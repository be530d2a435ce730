#include "server/engine/benches.h"

#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <csignal>
#include <filesystem>

#include "base/fields.h"
#include "daq/not_at_zero.h"
#include "daq/registry.h"

namespace ferrobench::server {

namespace fs = std::filesystem;

namespace {

// The process that a bench's socket is named after.
bool is_alive(std::string_view socket) {
  socket.remove_prefix(bench::socket_prefix.size());
  pid_t process = 0;
  const auto end = std::from_chars(socket.data(), socket.data() + socket.size(), process);
  return end.ec == std::errc() && process > 0 && (kill(process, 0) == 0 || errno != ESRCH);
}

}  // namespace

void bring_to_zero(const std::shared_ptr<BenchLink>& link, const std::string& driver,
                   const nlohmann::json& configuration) {
  HeldDevice device(link, driver, configuration);
  if (device.facts().output != 0) throw Error(ErrorCode::device_lost, "it does not obey");
}

Benches::Benches(bench::Opener open, Hazards& hazards) : open_(std::move(open)), hazards_(hazards) {}

Benches::~Benches() = default;

std::shared_ptr<BenchLink> Benches::process() {
  const std::scoped_lock lock(mutex_);
  if (!process_ || process_->lost()) {
    if (process_) dead_.push_back(std::move(process_));
    process_ = BenchLink::to_process();
    attend(process_);
  }
  return process_;
}

void Benches::attend(const std::shared_ptr<BenchLink>& link) {
  link->when_lost = [this, died = link.get()] { return bring_to_zero(died); };
}

std::shared_ptr<HeldDevice> Benches::open(const std::string& kind, const nlohmann::json& config) {
  const bool here = open_ || kind == "replay";
  if (!here) daq::device_kind(kind).check(config);
  std::shared_ptr<BenchLink> link;
  if (here) {
    const std::scoped_lock lock(mutex_);
    if (!thread_)
      thread_ =
          BenchLink::to_thread(open_ ? open_ : [](const std::string& name, const nlohmann::json& given) {
            return daq::open_device(name, given);
          });
    link = thread_;
  } else {
    link = process();
  }
  auto device = std::make_shared<HeldDevice>(link, kind, config);
  const auto& info = device->facts().info;
  // Opening a device brings its output to zero.
  hazards_.resolve(text_at(info, "serial_number"));
  if (!here) keep({.device = device, .driver = kind, .configuration = configuration_for_zero(info)});
  return device;
}

void Benches::keep(Held held) {
  if (held.configuration.is_null()) return;
  held.unit = text_at(held.configuration, "serial_number");
  const std::scoped_lock lock(mutex_);
  std::erase_if(held_, [](const Held& h) { return !h.taken_over && h.device.expired(); });
  held_.push_back(std::move(held));
}

// In the thread of the link that has died.
std::string Benches::bring_to_zero(const BenchLink* died) {
  std::vector<Held> left;
  {
    const std::scoped_lock lock(mutex_);
    if (process_.get() == died) left.swap(held_);
  }
  std::string out;
  for (const auto& held : left) {
    if (!held.taken_over && held.device.expired()) continue;
    try {
      server::bring_to_zero(process(), held.driver, held.configuration);
      hazards_.resolve(held.unit);
    } catch (const std::exception& failure) {
      const auto warning = daq::not_at_zero(held.driver + " unit " + held.unit + ": " + failure.what());
      hazards_.add(held.unit, warning);
      out += (out.empty() ? "" : "; ") + warning;
    }
  }
  return out;
}

std::shared_ptr<BenchLink> Benches::take_over(const std::string& folder) {
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure)) {
    const auto name = entry.path().filename().string();
    if (!name.starts_with(bench::socket_prefix) || !name.ends_with(bench::socket_suffix)) continue;
    auto link = BenchLink::taken_over(entry.path().string());
    if (!link) {  // its bench has died, or does not listen yet
      if (!is_alive(name)) unlink(entry.path().c_str());
      continue;
    }
    if (link->ready().run == 0) continue;
    const auto card = nlohmann::json::parse(link->ready().card, nullptr, false);
    const auto info = card.is_object() ? card.value("info", nlohmann::json()) : nlohmann::json();
    keep({.taken_over = true,
          .driver = text_at(info, "driver"),
          .configuration = configuration_for_zero(info)});
    const std::scoped_lock lock(mutex_);
    process_ = link;
    attend(link);
    return link;
  }
  return nullptr;
}

}  // namespace ferrobench::server
