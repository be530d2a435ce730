#include "daq/selftest.h"

#include <algorithm>
#include <iostream>
#include <limits>

#include "daq/usb/config.h"
#include "recordings/reports/table.h"
#include "server/cli/link.h"
#include "server/cli/words.h"

namespace ferrobench::cli {

using nlohmann::json;

namespace {

struct SelftestOptions {
  std::string device = "virtual", config{}, model{}, format{};
  double rate = daq::selftest_rate;  // Hz
};

// A device that is opened for the test and closed after it, or one that was open before.
class Opened {
 public:
  Opened(Link& link, const SelftestOptions& o) : link_(link), name_(o.device) {
    const auto open = link.call("device.list").at("open").get<std::vector<std::string>>();
    if (std::ranges::find(open, name_) != open.end()) return;
    json config = o.config.empty() ? json::object() : daq::usb::load_json(o.config);
    if (const auto model = model_argument(o.model); !model.is_null()) config["model"] = model;
    name_ = link.call("device.open", {{"device", o.device}, {"config", config}}).at("device");
    mine_ = true;
  }
  ~Opened() {
    if (!mine_) return;
    try {
      link_.call("device.close", {{"device", name_}});
    } catch (const std::exception& failure) {
      std::cerr << "ferrobench: the device stays open: " << failure.what() << '\n';
    }
  }
  Opened(const Opened&) = delete;
  Opened& operator=(const Opened&) = delete;
  const std::string& name() const { return name_; }

 private:
  Link& link_;
  std::string name_;
  bool mine_ = false;
};

recordings::Table table_of(const json& report) {
  recordings::Table out{.key = "selftest",
                        .title = "Self-test",
                        .columns = {{"quantity", "quantity", ""},
                                    {"measured", "measured", ""},
                                    {"lowest", "at least", ""},
                                    {"highest", "at most", ""},
                                    {"unit", "unit", ""},
                                    {"result", "result", ""}},
                        .rows = {},
                        .notes = {}};
  constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  for (const auto& row : report.at("rows"))
    out.rows.push_back({row.at("quantity").get<std::string>(),
                        row.at("measured").is_null() ? nothing : row.at("measured").get<double>(),
                        row.at("lowest").get<double>(), row.at("highest").get<double>(),
                        row.at("unit").get<std::string>(),
                        std::string(row.at("passed").get<bool>() ? "good" : "NOT GOOD")});
  out.notes.emplace_back(report.at("passed").get<bool>() ? "The device does what it says."
                                                         : "The device does not do what it says.");
  return out;
}

int selftest(const SelftestOptions& o, const Common& common) {
  const Interrupt interrupt;  // the test ends at zero first
  Link link(common);
  json report;
  {
    const Opened device(link, o);
    report = link.call("device.selftest", {{"device", device.name()}, {"sample_rate_Hz", o.rate}});
  }
  std::cout << (o.format == "json" ? report.dump(2) + "\n" : to_text(table_of(report)));
  if (Interrupt::count() > 0) return exit_interrupted;
  return report.at("passed").get<bool>() ? exit_ok : exit_error;
}

}  // namespace

void add_selftest(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("selftest", "Does a device do what it says? Offset, gain, noise, rate");
  auto o = std::make_shared<SelftestOptions>();
  sub->add_option("--device", o->device, "kind of device, or one opened before")->capture_default_str();
  sub->add_option("--device-config", o->config, "what the device is and what is wired to it")
      ->type_name("FILE.json");
  sub->add_option("--model", o->model, "virtual device: model by name or file");
  sub->add_option("--rate", o->rate, "sample rate in Hz")->capture_default_str();
  sub->add_option("--format", o->format, "text or json")
      ->check(one_of({"text", "json"}))
      ->default_val("text");
  sub->footer(
      "Plays holds at zero and at 5e4 V/m (5 V on layers of 0.1 mm) with ramps between, two seconds in all,\n"
      "longer below 200 Hz:\n"
      "the amplifier's monitor, or the analog output itself, must be wired to the field's input. A specimen\n"
      "that rings or drifts in steps shows as noise of its channels.\n"
      "Exit code 1: something is not as the device states.\n"
      "Example:\n  ferrobench selftest --device usb --device-config bench.json");
  sub->callback([o, &common] { common.action = [o, &common] { return selftest(*o, common); }; });
}

}  // namespace ferrobench::cli
