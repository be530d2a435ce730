#include "recordings/format/version.h"

namespace ferrobench::recordings {

std::string_view software_version() {
  return FERROBENCH_VERSION;
}
std::string_view software_commit() {
  return FERROBENCH_COMMIT;
}

}  // namespace ferrobench::recordings
