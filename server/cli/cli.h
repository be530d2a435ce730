// The command line. Each subcommand is one function that adds itself to the program; what it does runs after
// parsing and returns the exit code.
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace ferrobench::cli {

enum ExitCode { exit_ok = 0, exit_error = 1, exit_usage = 2, exit_interrupted = 130 };

// What every subcommand shares.
struct Common {
  std::string data;             // --data; "": the default folder
  std::string socket;           // --socket; "": that of the data folder
  std::string lease;            // --lease; "": none
  std::function<int()> action;  // set by the subcommand that was chosen
  std::string data_folder() const;
  std::string socket_path() const;
};

void add_serve(CLI::App& app, Common& common);
void add_run(CLI::App& app, Common& common);
void add_replay(CLI::App& app, Common& common);
void add_rerun(CLI::App& app, Common& common);
void add_compare(CLI::App& app, Common& common);
void add_list(CLI::App& app, Common& common);
void add_recover(CLI::App& app, Common& common);
void add_report(CLI::App& app, Common& common);
void add_table(CLI::App& app, Common& common);
void add_simulate(CLI::App& app, Common& common);
void add_fit(CLI::App& app, Common& common);
void add_discover(CLI::App& app, Common& common);
void add_protocol(CLI::App& app, Common& common);
void add_model(CLI::App& app, Common& common);
void add_call(CLI::App& app, Common& common);
void add_export(CLI::App& app, Common& common);
void add_selftest(CLI::App& app, Common& common);

// The whole program: parses, acts, prints errors to stderr.
int run_program(int argc, const char* const* argv);
// The program without an action, for its help.
std::string help_of(const std::vector<std::string>& arguments);

// Arguments that are read alike by several subcommands.
// A name of the library, or a file (.json, .csv) as its JSON.
nlohmann::json protocol_argument(const std::string& given);
// A name, or a file as its JSON; null if nothing was given.
nlohmann::json model_argument(const std::string& given);
// "key=value" texts as an object; values are JSON where they parse as such. Error(invalid_params).
nlohmann::json set_argument(const std::vector<std::string>& settings);
// The file of a recording: a path, or a name in the store. Error(not_found).
std::string recording_argument(const std::string& given, const Common& common);
// To the file, or to stdout if "".
void write_output(const std::string& file, const std::string& text);

// Error(io_error) if the file is there and not to be replaced; removed if it is, unless it is `source`, the
// recording that the new one is made from: Error(invalid_params).
void demand_free(const std::string& file, bool replace, const std::string& source = "");

// Follows a run from its first status, with progress on stderr, until it is over; an interrupt asks for a
// safe stop. `ask` and `abort` are told the run's id. Returns the last status, with "interrupted".
nlohmann::json follow(nlohmann::json status, const std::function<nlohmann::json(const std::string& id)>& ask,
                      const std::function<void(const std::string& id, const std::string& reason)>& abort,
                      bool quiet);
// Says on stderr what went wrong, if anything did; the exit code.
int tell_end(const nlohmann::json& status);

// While it lives, Ctrl-C (and SIGTERM) only raises a flag.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  static int count();  // how often so far
};

// One line on a terminal, redrawn; elsewhere a line now and then, if it takes longer than a second. On
// stderr.
class ProgressLine {
 public:
  void show(const std::string& state, double progress, double seconds_left);
  void finish();

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  bool open_ = false;
  int last_tenth_ = -1;
  std::string last_state_;
};

}  // namespace ferrobench::cli
