#include "daq/registry.h"
#include "model/model.h"
#include "protocols/protocol.h"
#include "server/packaging/documents.h"

namespace ferrobench::packaging {

std::map<std::string, nlohmann::json> schemas() {
  std::map<std::string, nlohmann::json> out{{"protocol.schema.json", protocols::protocol_schema()},
                                            {"model.schema.json", model::model_schema()}};
  for (const auto& kind : daq::device_kinds())
    out["device-" + std::string(kind.name) + ".schema.json"] = kind.schema();
  return out;
}

}  // namespace ferrobench::packaging
