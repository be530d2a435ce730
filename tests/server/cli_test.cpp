#include "server/cli/cli.h"

#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

#include "engine_bench.h"
#include "model/effects/catalogue.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "server/cli/words.h"
#include "server/methods/methods.h"

namespace ferrobench::cli {
namespace {

using server::Folder;
using testing::HasSubstr;
using testing::MatchesRegex;

struct Said {
  int code = 0;
  std::string out, err;
};

// The program in this process, with a data folder of its own.
class Cli : public testing::Test {
 protected:
  Said run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"ferrobench", "--data", folder.path.string()});
    std::vector<const char*> argv;
    for (const auto& a : arguments) argv.push_back(a.c_str());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    Said said;
    said.code = run_program(static_cast<int>(argv.size()), argv.data());
    said.out = testing::internal::GetCapturedStdout();
    said.err = testing::internal::GetCapturedStderr();
    return said;
  }
  std::string file(const std::string& name) const { return (folder.path / name).string(); }
  std::string protocol() const {
    std::ofstream(file("trapezium.json")) << server::trapezium(0.2, 0.5).dump();
    return file("trapezium.json");
  }

  Folder folder;
};

TEST_F(Cli, HelpNamesEveryOptionOfTheFixedForms) {
  const std::vector<std::pair<std::vector<std::string>, std::vector<std::string>>> wanted{
      {{},
       {"--data", "--socket", "--version", "serve", "run", "list", "report", "table", "simulate", "fit",
        "protocol", "model", "call", "export", "replay", "rerun", "compare", "Exit codes"}},
      {{"replay"},
       {"RECORDING", "--verify", "--speed", "--fast", "--from", "--to", "--set", "--played", "--model",
        "--out", "--force", "--format", "--quiet", "Example"}},
      {{"rerun"}, {"RECORDING", "--device", "--out", "--force", "--notes", "--quiet", "Example"}},
      {{"compare"}, {"A", "B", "--format", "Exit code 1", "Example"}},
      {{"selftest"}, {"--device", "--device-config", "--model", "--format", "Exit code 1", "Example"}},
      {{"run"},
       {"PROTOCOL", "--device", "--model", "--fast", "--seed", "--out", "FILE.h5", "--set", "KEY=VALUE",
        "--force", "--notes", "--quiet", "Ctrl-C"}},
      {{"simulate"}, {"RECORDING", "--model", "--out", "OUT.h5"}},
      {{"report"}, {"RECORDING", "--format", "text", "md", "csv", "json", "html", "--out"}},
      {{"table"}, {"3.10", "3.11", "3.12", "3.13", "--format", "--model", "--set", "--seed", "--keep"}},
      {{"fit"},
       {"RECORDING", "--table", "--calibrate", "--model", "--set", "--free", "--starts", "--seed", "--out"}},
      {{"batch"}, {"discover", "fit", "report", "import", "index.html", "Exit codes", "Example"}},
      {{"batch", "discover"},
       {"MANIFEST", "--out", "--local", "--slurm", "--threads", "--chunk", "--replace", "--partition",
        "--time", "--sbatch-option", "--no-wait", "candidates", "Example"}},
      {{"batch", "import"}, {"files", "map", "area_m2", "Example"}},
      {{"call"}, {"METHOD", "JSON", "--url", "--ca", "--token-file"}},
      {{"serve"},
       {"--port", "--address", "--tls-certificate", "--tls-key", "--host", "--token-file", "audit",
        "/metrics"}},
      {{"limits"}, {"--format", "field_max=1.8kV/mm"}},
      {{"limits", "set"}, {"KEY=VALUE", "kV/mm", "Example"}},
      {{"list"}, {"--format", "recovered"}},
      {{"recover"}, {"PATH", "recovered", "already_whole", "ferrobench recover creep.h5"}},
      {{"export"}, {"RECORDING", "--format", "--out"}},
      {{"protocol"}, {"list", "show", "schema", "validate", "preview"}},
      {{"protocol", "preview"}, {"PROTOCOL", "--model", "--set"}},
      {{"model"}, {"list", "show", "schema"}}};
  for (const auto& [command, words] : wanted) {
    const auto help = help_of(command);
    for (const auto& word : words)
      EXPECT_NE(help.find(word), std::string::npos)
          << word << " is missing in the help of " << (command.empty() ? "ferrobench" : command.back());
  }
}

TEST_F(Cli, WrongUsageIsTwo) {
  EXPECT_EQ(run({}).code, exit_usage);
  EXPECT_EQ(run({"rum"}).code, exit_usage);
  EXPECT_EQ(run({"run"}).code, exit_usage);
  EXPECT_EQ(run({"run", "full-loops", "--fats"}).code, exit_usage);
  EXPECT_EQ(run({"table", "3.14"}).code, exit_usage);
  EXPECT_EQ(run({"report", "x.h5", "--format", "docx"}).code, exit_usage);
  EXPECT_EQ(run({"run", "--help"}).code, exit_ok);
}

TEST_F(Cli, ErrorsSayWhatToDo) {
  auto said = run({"run", "creep-6-holds-fats", "--fast", "--model", "soft-pzt"});
  EXPECT_EQ(said.code, exit_error);
  EXPECT_NE(said.err.find("creep-6-holds-fast"), std::string::npos) << said.err;
  said = run({"run", protocol(), "--fast", "--model", "soft-pzt", "--set", "prestres_MPa=4"});
  EXPECT_EQ(said.code, exit_error);
  EXPECT_NE(said.err.find("did you mean \"prestress_MPa\""), std::string::npos) << said.err;
  said = run({"run", protocol(), "--fast", "--set", "top"});
  EXPECT_EQ(said.code, exit_error);
  EXPECT_NE(said.err.find("KEY=VALUE"), std::string::npos) << said.err;
  EXPECT_EQ(run({"report", file("none.h5")}).code, exit_error);
  said = run({"call", "system.info"});
  EXPECT_EQ(said.code, exit_error);
  EXPECT_NE(said.err.find("ferrobench serve"), std::string::npos) << said.err;
  EXPECT_TRUE(run({"list"}).out.empty());  // none of these left a recording
}

TEST_F(Cli, AWrongWordIsAnsweredByTheNearest) {
  const auto said = [&](const std::vector<std::string>& arguments) {
    const auto all = run(arguments);
    EXPECT_EQ(all.code, exit_usage) << all.err;
    return all.err;
  };
  EXPECT_THAT(said({"rum"}),
              HasSubstr("there is no command \"rum\"; did you mean \"run\"?\nCommands: serve, run"));
  EXPECT_THAT(said({"protocol", "shwo", "full-loops"}), HasSubstr("did you mean \"show\"?"));
  EXPECT_THAT(said({"run", "full-loops", "--fats"}), HasSubstr("no option --fats; did you mean \"--fast\"?"));
  EXPECT_THAT(said({"run", "full-loops", "--dat", "x"}), HasSubstr("did you mean \"--data\"?"));
  EXPECT_THAT(said({"run", "full-loops", "extra"}), HasSubstr("run takes no further \"extra\""));
  EXPECT_THAT(said({"report", "x", "--format", "htlm"}),
              HasSubstr("did you mean \"html\"? Allowed: text, md, csv, json or html"));
  EXPECT_THAT(said({"run", "full-loops", "--seed", "abc"}),
              HasSubstr("\"abc\" is not a number of at least 0"));
  EXPECT_THAT(said({"serve", "--port", "abc"}), HasSubstr("not a number from 0 to 65535"));
  EXPECT_THAT(said({}), HasSubstr("a command is wanted: serve"));
  EXPECT_THAT(run({"run", "full-lops", "--fast"}).err,
              HasSubstr("did you mean \"full-loops\"? Allowed: creep-"));
  EXPECT_THAT(run({"run", "full-loops", "--model", "sof"}).err, HasSubstr("did you mean \"soft-pzt\"?"));
}

TEST_F(Cli, ProblemsAreToldWhereAndHowTheUserWroteThem) {
  auto said = run({"run", "full-loops", "--fast", "--set", "rate=1000"}).err;
  EXPECT_THAT(said, HasSubstr("--set rate (full-loops: /segments/0/rate): the field changes too fast"));
  EXPECT_THAT(said, HasSubstr("1000 kV/mm/s; allowed: at most 100 kV/mm/s"));
  EXPECT_EQ(std::ranges::count(said, '\n'), 2) << "one problem, told once: " << said;
  EXPECT_THAT(run({"run", "full-loops", "--set", "rate=-1"}).err,
              HasSubstr("is outside its range: -1 kV/mm/s; allowed: 1e-09 to 1e+09 kV/mm/s"));
  EXPECT_THAT(run({"run", "full-loops", "--set", "model.material.barrier=-3"}).err,
              HasSubstr("--set model.material.barrier: is outside its range: -3 J/m^3"));
  EXPECT_THAT(
      run({"run", "full-loops", "--set", "prestress_MPa=8e6"}).err,
      HasSubstr("--set prestress_MPa: is outside its range: 8000000 MPa; allowed: -1000 to 10000 MPa"));
  EXPECT_THAT(
      run({"run", "full-loops", "--fast", "--set", "device.past=poled"}).err,
      HasSubstr("--set device.past: must be an object: \"poled\" (for example 'device.past={\"kind\": "
                "\"poled_minus\"}')"));
  EXPECT_THAT(
      run({"run", "full-loops", "--fast", "--set", "sample_rate_Hz=0"}).err,
      HasSubstr("is outside the range of the rate with 4 channels: 0 Hz; allowed: 0.25 to 125000 Hz"));
  EXPECT_THAT(run({"run", "full-loops", "--fast", "--device", "vitual"}).err,
              HasSubstr("did you mean \"virtual\"?"));
  EXPECT_THAT(run({"queue", "add", "full-loops", "--sweep", "rate=1:100"}).err,
              HasSubstr("has no count: \"rate=1:100\" (for example --sweep rate=1:100:5"));
  EXPECT_THAT(run({"discover", "--model", "soft-pzt"}).err, HasSubstr("none was given"));
  EXPECT_THAT(run({"run", "full-loops", "--fast", "--set", "device.chrage.enabled=false"}).err,
              HasSubstr("--set device.chrage: is not a known key; did you mean \"charge\"?"));

  auto mine = nlohmann::json::parse(std::ifstream(protocol()));
  mine["segments"][2].erase("time");
  mine["sample_rate_Hz"] = 20000;  // fast enough to see the ramp
  mine["segments"][2]["rate"] = 1000;
  std::ofstream(file("mine.json")) << mine.dump();
  const auto place = file("mine.json") + ": /segments/2/rate: the field changes too fast";
  EXPECT_THAT(run({"run", file("mine.json"), "--fast"}).err, HasSubstr(place));
  const auto preview = run({"protocol", "preview", file("mine.json")});
  EXPECT_EQ(preview.code, exit_error);
  EXPECT_THAT(preview.err, HasSubstr(place));
  mine["segments"][2]["rate"] = "fast";
  std::ofstream(file("mine.json")) << mine.dump();
  EXPECT_THAT(
      run({"protocol", "validate", file("mine.json")}).err,
      HasSubstr(file("mine.json") + ": /segments/2/rate: must be a number: \"fast\"; its unit is kV/mm/s\n"));
  std::ofstream(file("mine.json")) << "{";
  EXPECT_THAT(run({"protocol", "validate", file("mine.json")}).err,
              HasSubstr(file("mine.json") + ": the protocol is not JSON"));
  for (const auto& text : {said, preview.err, preview.out})
    EXPECT_EQ(text.find_first_of("{}"), std::string::npos) << text;
}

TEST_F(Cli, HintsNameCommandsThatExist) {
  EXPECT_THAT(run({"report", "nothing"}).err, HasSubstr("'ferrobench list' names them"));
  EXPECT_THAT(run({"model", "show", "qqqqq"}).err, HasSubstr("'ferrobench model list' names them"));
  EXPECT_EQ(with_commands("wait, or run.abort it; not run.abort.now"),
            "wait, or 'ferrobench call run.abort' it; not run.abort.now");
  server::Hub hub;
  server::Engine engine(folder.path / "other", hub);
  server::Dispatcher rpc;
  add_all_methods(rpc, engine);
  for (const auto& [method, command] : hinted_commands()) {
    EXPECT_TRUE(rpc.methods().contains(method)) << method;
    std::istringstream words{std::string(command)};
    std::string first, second;
    words >> first >> second;
    EXPECT_NO_THROW(help_of({first})) << command;
    if (first == "call") {
      EXPECT_EQ(second, method);
    } else if (!second.empty()) {
      EXPECT_NO_THROW(help_of({first, second})) << command;
    }
  }
}

TEST_F(Cli, EffectsAreListedWithUnitsAndRanges) {
  const auto all = run({"effects"});
  EXPECT_EQ(all.code, exit_ok) << all.err;
  const auto listed = nlohmann::json::parse(run({"effects", "--json"}).out).at("effects");
  EXPECT_EQ(listed.size(), model::effect_catalogue().size());
  for (const auto& effect : model::effect_catalogue())
    EXPECT_THAT(all.out, HasSubstr(std::string(effect.id) + " ("));
  const auto one = run({"effects", "contact_gap"});
  EXPECT_THAT(one.out, HasSubstr("F_spring = k max(0, x - gap)"));
  EXPECT_THAT(one.out, testing::ContainsRegex("gap +m +1e-08 to 2e-05\n"));
  EXPECT_THAT(run({"effects", "charge_offset_current"}).out,
              HasSubstr("A              1e-10 to 1e-05, either sign"));
  EXPECT_THAT(run({"effects", "empirical_rate"}).out, HasSubstr("empirical: never a candidate"));
  EXPECT_THAT(run({"effects", "contact_gab"}).err, HasSubstr("did you mean \"contact_gap\"?"));
  const auto unknown = run({"effects", "qqqqq"});
  EXPECT_EQ(unknown.code, exit_error);
  EXPECT_THAT(unknown.err, HasSubstr("'ferrobench effects' lists them"));
}

TEST_F(Cli, PreviewCallsASineASineAndSpeaksInTheProgramsUnit) {
  std::ofstream(file("sine.json"))
      << R"({"format": "ferrobench-protocol", "version": 1, "name": "sine", "unit": "V",
      "segments": [{"kind": "sine", "amplitude": 50, "center": 50, "phase": -90, "frequency": 2, "cycles": 3}]})";
  const auto said = run({"protocol", "preview", file("sine.json"), "--model", "soft-pzt"});
  EXPECT_EQ(said.code, exit_ok) << said.err;
  EXPECT_THAT(said.out, HasSubstr("from 0 to 100 V, steepest"));
  EXPECT_THAT(said.out, HasSubstr("sine  to"));
  EXPECT_THAT(said.out, HasSubstr(": 50 V about 50 V at 2 Hz"));
}

TEST_F(Cli, LimitsAreShownAndSetInUnitsPeopleUse) {
  const auto shown = run({"limits"});
  EXPECT_EQ(shown.code, exit_ok) << shown.err;
  EXPECT_THAT(shown.out, HasSubstr("1.6 kV/mm"));
  EXPECT_EQ(nlohmann::json::parse(run({"limits", "--format", "json"}).out)["field_max"], 1.6e6);
  const auto refused = [&](const std::string& setting) {
    const auto said = run({"limits", "set", setting});
    EXPECT_EQ(said.code, exit_error);
    return said.err;
  };
  EXPECT_THAT(refused("field_max=2"),
              HasSubstr("field_max: has no unit: \"2\"; allowed: kV/mm, MV/m, kV/m or V/m"));
  EXPECT_THAT(shown.out, HasSubstr("5 %"));
  EXPECT_THAT(refused("monitor_margin=0.5"),
              HasSubstr("monitor_margin: has no unit: \"0.5\"; allowed: \"%\""));
  EXPECT_THAT(refused("monitor_margin=10%"), HasSubstr("ferrobench serve"));
  EXPECT_THAT(refused("field_max=2 furlongs"), HasSubstr("not known here"));
  EXPECT_THAT(refused("feild_max=2kV/mm"), HasSubstr("did you mean \"field_max\"?"));
  EXPECT_THAT(refused("field_max=1.8kV/mm"), HasSubstr("ferrobench serve"));
}

TEST_F(Cli, RunReportExportSimulate) {
  const auto out = file("a.h5");
  auto said = run({"run", protocol(), "--device", "virtual", "--model", "soft-pzt", "--fast", "--seed", "5",
                   "--out", out, "--set", "top=0.8", "--set", "prestress_MPa=4"});
  ASSERT_EQ(said.code, exit_ok) << said.err;
  EXPECT_EQ(said.out, out + "\n");
  said = run({"run", protocol(), "--model", "soft-pzt", "--fast", "--out", out});
  EXPECT_EQ(said.code, exit_error);
  EXPECT_NE(said.err.find("--force"), std::string::npos) << said.err;

  ASSERT_EQ(run({"run", protocol(), "--model", "soft-pzt", "--fast", "--seed", "5", "--out", file("b.h5"),
                 "--set", "top=0.8", "--set", "prestress_MPa=4"})
                .code,
            exit_ok);
  const auto a = recordings::read_recording(out), b = recordings::read_recording(file("b.h5"));
  for (const auto channel : recordings::all_channels) EXPECT_EQ(a.at(channel), b.at(channel));

  for (const std::string format : {"text", "md", "csv", "json", "html"}) {
    said = run({"report", out, "--format", format});
    EXPECT_EQ(said.code, exit_ok) << said.err;
    EXPECT_GT(said.out.size(), 200u) << format;
  }
  said = run({"export", out, "--out", file("a.csv")});
  EXPECT_EQ(said.code, exit_ok) << said.err;
  std::ifstream csv(file("a.csv"));
  std::size_t lines = 0;
  for (std::string line; std::getline(csv, line);) ++lines;
  EXPECT_EQ(lines, a.size() + 1);

  said = run({"simulate", out, "--out", file("s.h5")});
  EXPECT_EQ(said.code, exit_ok) << said.err;
  EXPECT_NE(said.err.find("Estimated errors"), std::string::npos) << said.err;
  const auto s = recordings::read_recording(file("s.h5"));
  EXPECT_EQ(s.size(), a.size());
  EXPECT_EQ(s.header.load.prestress, 4e6);
}

TEST_F(Cli, RecoverMakesTheFilesOfRunsThatBrokeOff) {
  auto said = run({"recover"});
  EXPECT_EQ(said.code, exit_ok);
  EXPECT_NE(said.err.find("nothing to recover"), std::string::npos) << said.err;

  const auto recordings = folder.path / "recordings";
  ASSERT_EQ(run({"run", protocol(), "--model", "soft-pzt", "--fast", "--out", file("a.h5")}).code, exit_ok);
  const auto whole = recordings::read_recording(file("a.h5"));
  {
    recordings::Writer writer(recordings / "broken.h5", whole.header, recordings::all_channels);
    recordings::Rows rows{.time = whole.time, .channels = {}, .counts = {}};
    for (const auto channel : recordings::all_channels)
      rows.channels.at(static_cast<std::size_t>(channel)) = whole.at(channel);
    writer.append(rows);
  }
  std::ofstream(recordings / "other.h5.journal") << std::string(500, '?');
  EXPECT_EQ(run({"report", "broken"}).code, exit_ok);  // of what there is
  EXPECT_NE(run({"list"}).out.find("broken_off"), std::string::npos);

  said = run({"recover"});
  EXPECT_EQ(said.code, exit_error);  // the other one
  EXPECT_NE(said.out.find("recovered"), std::string::npos) << said.out;
  EXPECT_NE(said.err.find("other.h5"), std::string::npos) << said.err;
  EXPECT_EQ(recordings::read_recording(recordings / "broken.h5").at(recordings::Channel::charge),
            whole.at(recordings::Channel::charge));
  EXPECT_NE(run({"list"}).out.find("recovered"), std::string::npos);
  said = run({"recover", "broken"});
  EXPECT_EQ(said.code, exit_ok);
  EXPECT_NE(said.out.find("already_whole"), std::string::npos) << said.out;
  EXPECT_EQ(run({"recover", file("none.h5")}).code, exit_error);
}

// Texts of a file may hold what a terminal obeys, or what breaks a line.
TEST_F(Cli, TextsOfAFileReachTheTerminalSpelledOut) {
  recordings::Recording r;
  r.header.title = "good\x1b]0;owned\a\nsecond line";
  r.header.start_time = "2026-01-01T00:00:00Z";
  r.header.specimen = {"a\x1b[31mstack", 0.01, 1e-4, 1e-4, 10};
  r.header.device = {{"driver", "virtual\x1b[2J"}};
  r.header.model = {{"name",
                     "\xc2\x9b"
                     "31m"}};
  r.status = "aborted";
  r.reason = "because\rnothing";
  r.time = {0, 1, 2};
  r.set(recordings::Channel::field) = {0, 1e6, 0};
  r.set(recordings::Channel::displacement) = {0, 1e-6, 0};
  r.events = {{1, "note\x1b[5m",
               "\xe2\x80\xae"
               "dlrow"}};
  r.segments = {{0, 2, "ramp", "up\x1b[1m", 1e6, 1e6}};
  std::filesystem::create_directories(folder.path / "recordings");
  recordings::write_recording(file("recordings/hostile.h5"), r);
  auto other = r;
  other.reason = "\x1b[7m";
  recordings::write_recording(file("recordings/other.h5"), other);
  for (const std::vector<std::string>& command : {std::vector<std::string>{"list"},
                                                  {"report", "hostile"},
                                                  {"report", "hostile", "--format", "md"},
                                                  {"report", "hostile", "--format", "csv"},
                                                  {"report", "hostile", "--format", "html"},
                                                  {"compare", "hostile", "other"},
                                                  {"report", "\x1b[31m"},
                                                  {"replay", "hostile", "--from", "9"}}) {
    const auto said = run(command);
    for (const auto* forbidden : {"\x1b", "\a", "\r", "\xc2\x9b", "\xe2\x80\xae"})
      EXPECT_EQ((said.out + said.err).find(forbidden), std::string::npos)
          << command[0] << said.out << said.err;
  }
  const auto listed = run({"list"}).out;
  EXPECT_NE(listed.find("good\\x1b]0;owned\\x07\\nsecond line"), std::string::npos) << listed;
}

TEST_F(Cli, RunsATableOfTimeAndLevel) {
  std::ofstream(file("steps.csv")) << "time,level\n0,0\n0.5,1\n1,1\n1.5,0\n";
  const auto said = run({"run", file("steps.csv"), "--model", "soft-pzt", "--fast"});
  ASSERT_EQ(said.code, exit_ok) << said.err;
  const auto r = recordings::read_recording(said.out.substr(0, said.out.size() - 1));
  EXPECT_EQ(r.header.protocol["name"], "steps");
  EXPECT_DOUBLE_EQ(*std::ranges::max_element(r.at(recordings::Channel::command)), 1e6);
  EXPECT_NE(run({"list"}).out.find("steps_"), std::string::npos);
}

TEST_F(Cli, TablesCompareEveryCell) {
  const auto said = run({"table", "3.13", "--model", "soft-pzt", "--format", "json"});
  ASSERT_EQ(said.code, exit_ok) << said.err;
  const auto table = nlohmann::json::parse(said.out);
  EXPECT_EQ(table["table"], "3.13");
  ASSERT_EQ(table["cells"].size(), 4u);
  for (const auto& cell : table["cells"]) {
    EXPECT_EQ(cell["quantity"], "max_stroke_um");
    EXPECT_TRUE(cell.contains("rate_V_per_s"));
    EXPECT_GT(cell["measured"].get<double>(), 0);
    EXPECT_GT(cell["published"].get<double>(), 30);
  }
  EXPECT_GT(table["rms_log_error"]["max_stroke_um"].get<double>(), 0);
}

TEST_F(Cli, FitFindsAParameterAgain) {
  const std::vector<std::string> common{"--model", "soft-pzt", "--fast", "--set", "top=-0.8"};
  auto arguments = std::vector<std::string>{
      "run", protocol(), "--out", file("truth.h5"), "--set", "model.material.barrier=4.6e4"};
  arguments.insert(arguments.end(), common.begin(), common.end());
  ASSERT_EQ(run(arguments).code, exit_ok);
  const auto said = run({"fit", file("truth.h5"), "--model", "soft-pzt", "--free", "material.barrier",
                         "--starts", "1", "--out", file("fitted.json"), "--report", file("fit.html")});
  ASSERT_EQ(said.code, exit_ok) << said.err;
  std::ifstream page(file("fit.html"));
  const std::string html{std::istreambuf_iterator<char>(page), {}};
  const auto header = recordings::read_summary(file("truth.h5")).header;
  for (const auto& part : std::vector<std::string>{
           "material.barrier", "J/m^3", "displacement: measured less model", "<svg", "less their mean",
           "1 start, seed", header.title, header.start_time, header.entry_identifier})
    EXPECT_THAT(html, HasSubstr(part));
  for (const auto& text : {html, said.out}) {
    EXPECT_THAT(text, HasSubstr("The model explains the measurement to its noise: "));
    EXPECT_THAT(text, HasSubstr("No parameter ended at a bound of its range."));
  }
  EXPECT_NE(said.out.find("material.barrier"), std::string::npos);
  const auto fitted = nlohmann::json::parse(std::ifstream(file("fitted.json")));
  EXPECT_NEAR(fitted["material"]["barrier"].get<double>(), 4.6e4, 0.01 * 4.6e4);
  // The truth lies outside of the range that a fit may use.
  ASSERT_EQ(run({"run", protocol(), "--out", file("beyond.h5"), "--model", "soft-pzt", "--fast", "--set",
                 "model.material.permittivity_180=2e-7"})
                .code,
            exit_ok);
  const auto stuck = run({"fit", file("beyond.h5"), "--model", "soft-pzt", "--free",
                          "material.permittivity_180", "--starts", "1", "--out", file("stuck.json")});
  ASSERT_EQ(stuck.code, exit_ok) << stuck.err;
  EXPECT_THAT(stuck.out, MatchesRegex("The model misses the measurement by up to [0-9]+ times its noise .*"));
  EXPECT_THAT(stuck.out, HasSubstr("1 of 1 parameters ended at a bound of their range, so that the 95 % "
                                   "intervals are not to be trusted: search from more starts (--starts)"));
  EXPECT_EQ(run({"fit", "--model", "soft-pzt", "--out", file("f.json")}).code, exit_error);
  EXPECT_EQ(run({"fit", file("truth.h5"), "--calibrate", "--model", "soft-pzt", "--out", file("f.json"),
                 "--report", file("calibration.html")})
                .code,
            exit_error);
}

TEST_F(Cli, ReplayRerunCompare) {
  const auto a = file("a.h5"), b = file("b.h5"), c = file("c.h5");
  ASSERT_EQ(run({"run", protocol(), "--model", "soft-pzt", "--fast", "--out", a}).code, exit_ok);
  auto said = run({"replay", a, "--verify"});
  EXPECT_EQ(said.code, exit_ok) << said.err;
  EXPECT_NE(said.out.find("identical: 181 samples, 3 segments"), std::string::npos) << said.out;
  // The same report, but for the lines that name the run.
  said = run({"replay", a, "--fast"});
  EXPECT_EQ(said.code, exit_ok) << said.err;
  EXPECT_NE(said.out.find("Stroke"), std::string::npos) << said.out;
  said = run({"run", "--device", "replay:" + a, "--fast", "--out", b});
  EXPECT_EQ(said.code, exit_ok) << said.err;
  said = run({"compare", a, b});
  EXPECT_EQ(said.code, exit_ok) << said.out;
  EXPECT_NE(said.out.find("The samples are identical"), std::string::npos) << said.out;
  EXPECT_NE(said.out.find("/entry_identifier"), std::string::npos) << said.out;

  auto damaged = recordings::read_recording(a);
  damaged.channels[4]->at(17) += 1;
  recordings::write_recording(b, damaged);
  said = run({"replay", b, "--verify"});
  EXPECT_EQ(said.code, exit_error);
  EXPECT_NE(said.out.find("/entry/data/force, row 17: "), std::string::npos) << said.out;
  said = run({"compare", a, b, "--format", "json"});
  EXPECT_EQ(said.code, exit_error);
  const auto force = nlohmann::json::parse(said.out)["columns"][5];
  EXPECT_NEAR(force["maximum"].get<double>(), 1, 1e-9);
  EXPECT_NEAR(force["mean"].get<double>() * static_cast<double>(damaged.size()), 1, 1e-9);

  said = run({"rerun", a, "--out", c});
  EXPECT_EQ(said.code, exit_ok) << said.err;
  EXPECT_EQ(recordings::read_recording(c).header.device["rerun_of"],
            recordings::read_recording(a).header.entry_identifier);
  said = run({"replay", a, "--model", "soft-pzt", "--from", "0.1"});
  EXPECT_EQ(said.code, exit_ok) << said.err;
  EXPECT_NE(said.out.find("displacement"), std::string::npos) << said.out;
  EXPECT_EQ(run({"replay", a, "--verify", "--set", "force.gain=2"}).code, exit_error);
  EXPECT_EQ(run({"replay", a, "--fast", "--out", a, "--force"}).code, exit_error);
  EXPECT_TRUE(std::filesystem::exists(a));
  EXPECT_EQ(run({"replay", a, "--from", "99"}).code, exit_error);
}

TEST_F(Cli, SelftestMeasuresADevice) {
  std::ofstream(file("good.json")) << R"({"clock": "fast"})";
  const auto good = run({"selftest", "--device-config", file("good.json")});
  EXPECT_EQ(good.code, exit_ok) << good.out << good.err;
  for (const char* word : {"monitor offset", "monitor gain", "charge noise", "The device does what it says."})
    EXPECT_NE(good.out.find(word), std::string::npos) << word;
  std::ofstream(file("bad.json")) << R"({"clock": "fast", "field": {"gain": 1.05}})";
  const auto bad = run({"selftest", "--device-config", file("bad.json"), "--format", "json"});
  EXPECT_EQ(bad.code, exit_error) << bad.err;
  EXPECT_FALSE(nlohmann::json::parse(bad.out).at("passed").get<bool>());
  EXPECT_EQ(run({"selftest", "--device", "oscilloscope"}).code, exit_error);
}

TEST_F(Cli, LibraryAndSchemas) {
  EXPECT_NE(run({"protocol", "list"}).out.find("full-loops"), std::string::npos);
  EXPECT_NE(run({"model", "list"}).out.find("soft-pzt"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(run({"protocol", "show", "full-loops"}).out)["name"], "full-loops");
  server::Store(folder.path).put_protocol("mine", server::trapezium(0.2, 0.5));
  EXPECT_THAT(run({"protocol", "list"}).out, HasSubstr("mine"));
  EXPECT_EQ(nlohmann::json::parse(run({"protocol", "show", "mine"}).out)["name"], "mine");
  EXPECT_EQ(nlohmann::json::parse(run({"model", "show", "soft-pzt"}).out)["format"], "ferrobench-model");
  EXPECT_TRUE(nlohmann::json::parse(run({"protocol", "schema"}).out).contains("$schema"));
  EXPECT_TRUE(nlohmann::json::parse(run({"model", "schema"}).out).contains("$schema"));
  EXPECT_EQ(run({"protocol", "validate", protocol()}).code, exit_ok);
  std::ofstream(file("bad.json"))
      << R"({"format": "ferrobench-protocol", "version": 1, "segments": [{"kind": "rmap"}]})";
  const auto said = run({"protocol", "validate", file("bad.json")});
  EXPECT_EQ(said.code, exit_error);
  EXPECT_NE(said.err.find("/segments/0"), std::string::npos) << said.err;
  EXPECT_EQ(run({"protocol", "preview", protocol(), "--model", "soft-pzt"}).code, exit_ok);
  EXPECT_EQ(run({"protocol", "preview", protocol(), "--model", "soft-pzt", "--set", "top=3"}).code,
            exit_error);
}

}  // namespace
}  // namespace ferrobench::cli
