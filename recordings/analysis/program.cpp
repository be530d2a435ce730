#include "recordings/analysis/program.h"

#include "base/error.h"
#include "protocols/protocol.h"

namespace ferrobench::recordings {

std::optional<protocols::Waveform> program_of(const nlohmann::json& protocol) {
  if (!protocol.is_object()) return std::nullopt;
  try {
    return protocols::Protocol::from_json(protocol).expand();
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace ferrobench::recordings
