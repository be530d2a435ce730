#include <cstdio>
#include <filesystem>
#include <iostream>

#include "base/visible.h"
#include "protocols/protocol.h"
#include "server/cli/link.h"
#include "server/net/token.h"

namespace ferrobench::cli {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

struct Options {
  std::string name{}, model{};
  std::vector<std::string> set{};
};

int print(const json& value) {
  std::cout << value.dump(2) << '\n';
  return exit_ok;
}

int list_protocols(const Options&, const Common& common) {
  const auto listed = Link(common).call("protocol.list");
  for (const auto& p : listed.at("protocols"))
    std::printf("%-40s %s (%s)\n", p.at("name").get<std::string>().c_str(),
                visible(p.at("title").get<std::string>()).c_str(), p.at("source").get<std::string>().c_str());
  return exit_ok;
}

int list_models(const Options&, const Common& common) {
  const auto models = Link(common).call("model.list");
  for (const auto& m : models.at("models")) {
    const auto name = visible(m.at("name").get<std::string>());
    if (const auto error = m.value("error", ""); !error.empty()) {
      std::printf("%-24s cannot be used: %s\n", name.c_str(), visible(error).c_str());
      continue;
    }
    std::printf("%-24s %s%s\n", name.c_str(), visible(m.at("title").get<std::string>()).c_str(),
                m.at("name") == models.at("default") ? " (default)" : "");
  }
  return exit_ok;
}

int validate(const Options& o, const Common&) {
  const auto given = protocol_argument(o.name);
  server::resolve_protocol(given);
  std::cout << "valid\n";
  return exit_ok;
}

void print_segment(const json& s, const std::string& unit, double size) {
  const auto level = [&](const char* key) { return s.at(key).get<double>() / size; };
  const auto kind = s.at("kind").get<std::string>();
  std::printf("  %10.3f s  %-5s to %9.4f %s  %s", s.at("start_s").get<double>(), kind.c_str(), level("level"),
              unit.c_str(), visible(s.at("label").get<std::string>()).c_str());
  if (kind == "sine")
    std::printf(": %.4g %s about %.4g %s at %.4g Hz", level("amplitude"), unit.c_str(), level("center"),
                unit.c_str(), s.at("frequency_Hz").get<double>());
  std::printf("\n");
}

int preview(const Options& o, const Common& common) {
  json params{{"protocol", protocol_argument(o.name)}, {"set", set_argument(o.set)}, {"max_points", 2}};
  if (const auto model = model_argument(o.model); !model.is_null()) params["model"] = model;
  const auto p = Link(common).call("protocol.preview", params);
  const auto unit = p.at("unit").get<std::string>();
  const auto size = p.at("unit_V_per_m").get<double>();
  const auto samples = p.at("samples").get<long long>(), recorded = p.at("recorded_samples").get<long long>();
  const auto fewer = recorded < samples ? " (" + std::to_string(recorded) + " recorded)" : "";
  std::printf("%.6g s, %lld samples%s at %.6g Hz, from %.4g to %.4g %s, steepest %.4g %s/s\n",
              p.at("duration_s").get<double>(), samples, fewer.c_str(), p.at("sample_rate_Hz").get<double>(),
              p.at("field_min").get<double>() / size, p.at("field_max").get<double>() / size, unit.c_str(),
              p.at("max_slew").get<double>() / size, unit.c_str());
  for (const auto& s : p.at("segments")) print_segment(s, unit, size);
  std::cout << std::flush;
  if (p.at("problems").empty()) return exit_ok;
  throw server::failure_of("the program goes beyond a limit, and a run would refuse it",
                           {{"name", "limit_exceeded"}, {"problems", p.at("problems")}});
}

int print_effects(const json& effects) {
  for (const auto& e : effects) {
    const auto text = [&e](const char* key) { return e.at(key).get<std::string>(); };
    std::printf("%s (%s%s)\n  %s\n  shows: %s\n", text("id").c_str(), text("family").c_str(),
                e.at("empirical").get<bool>() ? ", empirical: never a candidate" : "",
                text("equation").c_str(), text("shows").c_str());
    for (const auto& p : e.at("parameters")) {
      const auto sign = p.at("sign").get<std::string>();
      std::printf("  %-20s %-14s %.4g to %.4g%s\n", p.at("name").get<std::string>().c_str(),
                  p.at("unit").get<std::string>().c_str(), p.at("low").get<double>(),
                  p.at("high").get<double>(), sign == "any" ? ", either sign" : "");
    }
  }
  return exit_ok;
}

CLI::App* add(CLI::App* parent, const std::string& name, const std::string& help,
              const std::shared_ptr<Options>& o, Common& common,
              const std::function<int(const Options&, const Common&)>& action) {
  auto* sub = parent->add_subcommand(name, help);
  sub->callback(
      [o, &common, action] { common.action = [o, &common, action] { return action(*o, common); }; });
  return sub;
}

}  // namespace

void add_protocol(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand(
      "protocol", "The shipped experiments, those put into the data folder, and help with writing one's own");
  sub->require_subcommand(1);
  sub->footer(
      "A protocol's file can be used wherever a name can; 'ferrobench call protocol.put' keeps it under a "
      "name.\n"
      "Examples:\n"
      "  ferrobench protocol show full-loops > mine.json\n"
      "  ferrobench protocol preview mine.json --set rate=10\n"
      "  ferrobench run mine.json --fast");
  auto o = std::make_shared<Options>();
  add(sub, "list", "Names, titles and sources", o, common, list_protocols);
  add(sub, "show", "One as JSON: a start for one's own", o, common,
      [](const Options& opt, const Common& c) {
        const server::Store store(c.data_folder());
        return print(server::resolve_protocol(protocol_argument(opt.name), &store).json());
      })
      ->add_option("PROTOCOL", o->name, "name or file")
      ->required();
  add(sub, "schema", "JSON Schema of a protocol file", o, common,
      [](const Options&, const Common&) { return print(protocols::protocol_schema()); });
  add(sub, "validate", "Every problem of a protocol file with its path", o, common, validate)
      ->add_option("FILE", o->name, "the protocol")
      ->required();
  auto* show =
      add(sub, "preview", "What a run would do: length, extremes, segments, limits that it goes beyond", o,
          common, preview);
  show->add_option("PROTOCOL", o->name, "name or file")->required();
  show->add_option("--model", o->model, "by name or file");
  show->add_option("--set", o->set, "as for run; again for more")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

void add_model(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("model", "The shipped parameter sets, and those put into the data folder");
  sub->require_subcommand(1);
  sub->footer(
      "A model's file can be used wherever a name can; 'ferrobench call model.put' keeps it under a name.\n"
      "Examples:\n"
      "  ferrobench model show soft-pzt > mine.json\n"
      "  ferrobench run full-loops --fast --model mine.json");
  auto o = std::make_shared<Options>();
  add(sub, "list", "Names and titles", o, common, list_models);
  add(sub, "show", "One as JSON: a start for one's own", o, common,
      [](const Options& opt, const Common& c) {
        return print(server::resolve_model(model_argument(opt.name), server::Store(c.data_folder())));
      })
      ->add_option("MODEL", o->name, "name or file")
      ->required();
  add(sub, "schema", "JSON Schema of a model file", o, common,
      [](const Options&, const Common& c) { return print(Link(c).call("model.schema")); });
}

void add_effects(CLI::App& app, Common& common) {
  struct Choice {
    std::string effect{};
    bool as_json = false;
  };
  auto* sub = app.add_subcommand(
      "effects", "The catalogue: what a model may hold beside its physics, and what discover can name");
  sub->footer(
      "Of each effect: its equation, where it shows, and its parameters with unit and plausible range.\n"
      "Examples:\n"
      "  ferrobench effects\n"
      "  ferrobench effects domain_wall_drag --json");
  auto o = std::make_shared<Choice>();
  sub->add_option("EFFECT", o->effect, "id of one; default: all");
  sub->add_flag("--json", o->as_json, "as model.effects gives it");
  sub->callback([o, &common] {
    common.action = [o, &common] {
      const auto listed = Link(common).call("model.effects", {{"effect", o->effect}});
      return o->as_json ? print(listed) : print_effects(listed.at("effects"));
    };
  });
}

namespace {

// The lease is shown where it is asked for only: one that ran out must not keep run.abort from the daemon.
json call_here(const Common& common, const std::string& method, const json& params) {
  auto client = server::Client::connect(common.socket_path());
  try {
    return client.call(method, params);
  } catch (const Error& refusal) {
    if (refusal.code() != ErrorCode::not_controller || common.lease.empty()) throw;
  }
  client.call("lease.present", {{"lease", common.lease}});
  return client.call(method, params);
}

}  // namespace

void add_call(CLI::App& app, Common& common) {
  struct Call {
    std::string method, params = "{}", url, ca, token_file;
  };
  auto* sub = app.add_subcommand("call", "One JSON-RPC call to the running daemon; prints the result");
  auto o = std::make_shared<Call>();
  sub->add_option("METHOD", o->method, "rpc.discover describes them all")->required();
  sub->add_option("JSON", o->params, "parameters, by name or position")->capture_default_str();
  auto* url = sub->add_option("--url", o->url, "a daemon on another machine, https://HOST:PORT");
  sub->add_option("--ca", o->ca, "PEM file to trust it by; default: what the system trusts")
      ->type_name("FILE")
      ->needs(url);
  sub->add_option("--token-file", o->token_file,
                  "its token, mode 0600; default: ~/.local/state/ferrobench/token")
      ->type_name("FILE")
      ->needs(url);
  sub->footer(
      "Examples:\n"
      "  ferrobench call run.status\n"
      "  ferrobench call run.start '{\"protocol\": \"full-loops\", \"fast\": true}'\n"
      "  ferrobench call --url https://bench.lab:8377 --ca bench.pem --token-file bench.token run.status");
  sub->callback([o, &common] {
    common.action = [o, &common] {
      const auto params = parse_json_text(o->params, ErrorCode::invalid_params, "the JSON given");
      if (o->url.empty()) return print(call_here(common, o->method, params));
      const auto file = o->token_file.empty() ? server::state_folder() / "token" : fs::path(o->token_file);
      return print(
          server::call_remote({o->url, o->ca, server::load_token(file), common.lease}, o->method, params));
    };
  });
}

}  // namespace ferrobench::cli
