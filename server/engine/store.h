// The folder that holds what this bench has made: recordings, and models put there by clients.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "protocols/protocol.h"
#include "recordings/format/recording.h"

namespace ferrobench::server {

// $FERROBENCH_DATA, else ~/.local/share/ferrobench. Error(io_error) if neither is known.
std::filesystem::path default_data_folder();

class Store {
 public:
  // Makes the folders that are missing.
  explicit Store(std::filesystem::path folder);

  const std::filesystem::path& folder() const { return folder_; }
  std::filesystem::path recordings() const { return folder_ / "recordings"; }

  // A path in recordings() that is not taken: the stem, the time in UTC, and a number if need be. Another
  // program may be quicker: whoever makes the file keeps what is there, and asks again.
  std::filesystem::path new_recording(const std::string& stem) const;
  // Writes it under such a name.
  std::filesystem::path add_recording(const std::string& stem, const recordings::Recording& recording) const;
  // The file of a recording of this store by its name, with or without ".h5". Names come from outside: one
  // with anything but letters, digits and . _ - is Error(invalid_params). Error(not_found) with the nearest
  // name. A link is no recording. While a run goes on, or where one broke off, only the file's journal may be
  // there.
  std::filesystem::path recording(const std::string& name) const;
  // Where a client finds what it asks for by HTTP: a recording, or what recording.export wrote beside it.
  std::optional<std::string> download(const std::string& name) const;
  static bool is_taken(const std::filesystem::path& path);  // by a recording or its journal
  std::vector<std::string> recording_names() const;         // newest first

  // Shipped models and those put here, by name.
  std::vector<std::string> model_names() const;
  // Error(not_found) with the nearest name.
  nlohmann::json model(const std::string& name) const;
  // Checks it; a shipped model cannot be replaced (Error(busy)).
  void put_model(const std::string& name, const nlohmann::json& model) const;

  // Shipped protocols and those put here, likewise. What is put takes the name as its own.
  std::vector<std::string> protocol_names() const;
  protocols::Protocol protocol(const std::string& name) const;
  void put_protocol(const std::string& name, const nlohmann::json& protocol) const;

 private:
  std::filesystem::path folder_;
};

// Throws Error(invalid_params) unless `name` is fit to be a file's name.
void check_name(const std::string& name, const std::string& path);

// The model used where none is named: the actuator that most of the shipped experiments were made with.
std::string default_model_name();

}  // namespace ferrobench::server
