#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iostream>

#include "daq/usb/config.h"
#include "model/model.h"
#include "protocols/protocol.h"
#include "recordings/disk/new_file.h"
#include "recordings/file/recover.h"
#include "server/cli/link.h"
#include "server/methods/methods.h"

namespace ferrobench::cli {

using nlohmann::json;
namespace fs = std::filesystem;

std::string Common::data_folder() const {
  return data.empty() ? server::default_data_folder().string() : data;
}

std::string Common::socket_path() const {
  return socket.empty() ? (fs::path(data_folder()) / "daemon.sock").string() : socket;
}

std::optional<server::Client> running_daemon(const Common& common) {
  auto daemon = server::Client::try_connect(common.socket_path());
  if (daemon && !common.lease.empty()) daemon->call("lease.present", {{"lease", common.lease}});
  return daemon;
}

Link::Link(const Common& common) : client_(running_daemon(common)) {
  if (client_) return;
  engine_ = std::make_unique<server::Engine>(common.data_folder(), hub_);
  add_all_methods(rpc_, *engine_);
}

json Link::call(const std::string& method, const json& params) {
  return client_ ? client_->call(method, params) : rpc_.call(method, params, context_);
}

namespace {

bool looks_like_file(const std::string& given) {
  std::error_code failure;
  return given.find('/') != std::string::npos || given.ends_with(".json") || given.ends_with(".csv") ||
         fs::is_regular_file(given, failure);
}

std::atomic<int> interrupts{0};
void (*before_int)(int) = SIG_DFL;
void (*before_term)(int) = SIG_DFL;

}  // namespace

json protocol_argument(const std::string& given) {
  if (!looks_like_file(given)) return given;
  if (!given.ends_with(".csv")) return protocols::Protocol::from_file(given).json();
  auto protocol = protocols::Protocol::from_csv_file(given).json();
  const auto stem = fs::path(given).stem().string();
  protocol["name"] = stem;
  protocol["title"] = "Points from " + fs::path(given).filename().string();
  return protocol;
}

json model_argument(const std::string& given) {
  if (given.empty()) return nullptr;
  if (!looks_like_file(given)) return given;
  return model::to_json(model::model_from_file(given));
}

std::optional<protocols::Past> past_argument(const std::string& given) {
  if (given.empty()) return std::nullopt;
  return protocols::past_from_text(given);
}

CLI::Option* add_past(CLI::App* sub, std::string& past) {
  return sub
      ->add_option("--past", past,
                   "what the specimen has been through before: poled_plus, poled_minus, unpoled, cycled (the "
                   "program itself until it repeats), or, as JSON, what is partly poled or levels that were "
                   "visited, for example "
                   R"('{"kind": "partly_poled", "poling": -0.4}' or )"
                   R"('{"kind": "visited", "levels": [{"field_V_per_m": -1.5e6, "seconds": 2}]}'; )"
                   "default: what the recording says, or poled_plus")
      ->type_name("PAST");
}

json set_argument(const std::vector<std::string>& settings) {
  json out = json::object();
  for (const auto& setting : settings) {
    const auto split = setting.find('=');
    if (split == 0 || split == std::string::npos)
      throw Error(ErrorCode::invalid_params, "a setting is KEY=VALUE",
                  Problem{.path = "/set", .given = setting, .hint = "for example --set prestress_MPa=8"});
    const auto text = setting.substr(split + 1);
    auto value = json::parse(text, nullptr, false);
    out[setting.substr(0, split)] = value.is_discarded() ? json(text) : std::move(value);
  }
  return out;
}

json run_argument(const RunChoice& choice) {
  json out{{"device", choice.device},
           {"fast", choice.fast},
           {"seed", choice.seed},
           {"set", set_argument(choice.set)},
           {"notes", choice.notes}};
  if (!choice.protocol.empty()) out["protocol"] = protocol_argument(choice.protocol);
  if (!choice.config.empty()) out["config"] = daq::usb::load_json(choice.config);
  if (const auto model = model_argument(choice.model); !model.is_null()) out["model"] = model;
  return out;
}

std::optional<std::vector<std::string>> names_in_store(const std::vector<std::string>& given,
                                                       const Common& common) {
  const server::Store store(common.data_folder());
  std::vector<std::string> names;
  for (const auto& each : given) {
    const auto file = recording_argument(each, common);
    std::error_code failure;
    const fs::path path = fs::absolute(file, failure);
    if (failure || path.extension() != ".h5" ||
        !fs::equivalent(path.parent_path(), store.recordings(), failure))
      return std::nullopt;
    names.push_back(path.stem().string());
  }
  return names;
}

std::string recording_argument(const std::string& given, const Common& common) {
  std::error_code failure;
  if (fs::is_regular_file(recordings::present_file(given), failure)) return given;
  if (given.find('/') == std::string::npos)
    return server::Store(common.data_folder()).recording(given).string();
  throw Error(ErrorCode::not_found, "there is no file \"" + given + "\"",
              Problem{.path = "/recording",
                      .message = "is not there",
                      .hint = "recording.list names those of the data folder"});
}

TextOutput::TextOutput(std::string file, const std::vector<std::string>& sources) : file_(std::move(file)) {
  struct stat named {
  }, standard{};
  if (file_.empty() || file_ == "-") {
    kind_ = Kind::standard;
  } else if (stat(file_.c_str(), &named) == 0) {
    const bool same = fstat(STDOUT_FILENO, &standard) == 0 && named.st_dev == standard.st_dev &&
                      named.st_ino == standard.st_ino;
    if (same)
      kind_ = Kind::standard;
    else if (S_ISCHR(named.st_mode) || S_ISFIFO(named.st_mode))
      kind_ = Kind::stream;
  }
  if (kind_ == Kind::file) recordings::demand_place(file_, recordings::Existing::replace, sources);
}

void TextOutput::write(const std::string& text) const {
  switch (kind_) {
    case Kind::standard:
      std::cout << text << std::flush;
      break;
    case Kind::stream: {
      const auto stream = recordings::open_file(file_, O_WRONLY | O_NOCTTY);
      if (!stream) recordings::throw_write_failure(file_, errno);
      recordings::write_all(stream, text, file_);
      break;
    }
    case Kind::file: {
      recordings::NewFile out(file_, recordings::Existing::replace);
      out.write(text);
      out.put();
      break;
    }
  }
}

Interrupt::Interrupt() {
  interrupts = 0;
  before_int = std::signal(SIGINT, [](int) { ++interrupts; });
  before_term = std::signal(SIGTERM, [](int) { ++interrupts; });
}

Interrupt::~Interrupt() {
  static_cast<void>(std::signal(SIGINT, before_int));
  static_cast<void>(std::signal(SIGTERM, before_term));
}

int Interrupt::count() {
  return interrupts;
}

void ProgressLine::show(const std::string& state, double progress, double seconds_left) {
  static const bool terminal = isatty(STDERR_FILENO) != 0;
  const int percent = static_cast<int>(100 * progress);
  std::string left;
  if (seconds_left >= 0) {
    const auto s = std::lround(seconds_left);
    left = s >= 60 ? std::to_string(s / 60) + " min " + std::to_string(s % 60) + " s left"
                   : std::to_string(s) + " s left";
  }
  if (terminal) {
    constexpr int width = 30;
    const auto full = static_cast<std::size_t>(width * progress);
    const std::string bar = std::string(full, '#') + std::string(width - full, '.');
    static_cast<void>(std::fprintf(stderr, "\r\033[K[%s] %3d %%  %s  %s", bar.c_str(), percent, state.c_str(),
                                   left.c_str()));
    open_ = true;
    return;
  }
  if (std::chrono::steady_clock::now() - begin_ < std::chrono::seconds(1)) return;
  if (percent / 10 == last_tenth_ && state == last_state_) return;
  last_tenth_ = percent / 10;
  last_state_ = state;
  static_cast<void>(std::fprintf(stderr, "%s: %d %%%s%s\n", state.c_str(), percent, left.empty() ? "" : ", ",
                                 left.c_str()));
}

void ProgressLine::finish() {
  if (open_) std::cerr << "\r\033[K";
  open_ = false;
}

}  // namespace ferrobench::cli
