// Who did what: a line of JSON for each call that controls or stops the bench, and for each request that was
// refused.
//
//   calls.jsonl      {"time", "client", "method", "outcome", "params"}; outcome is "ok" or the error's name
//   refusals.jsonl   {"time", "client", "request", "status", "name", "message"}
//
// Two files, so that a stranger who is refused a million times pushes out nothing but his own lines. They are
// only appended to; at `max_bytes` a file becomes calls.1.jsonl and so on, and the oldest goes. A thread of
// each file writes; where the disk falls behind, the oldest lines that wait are lost, and where it takes no
// more, the line; both are counted, and nobody ever waits.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "server/net/admission.h"
#include "server/rpc/dispatcher.h"

namespace ferrobench::server {

struct AuditLimits {
  std::size_t max_bytes = 8u << 20;  // of a file
  std::size_t old_files = 9;
  std::size_t waiting = 1024;  // lines
};

class Audit {
 public:
  // Makes the folder (mode 0700); its files have mode 0600. `secret` never gets into a line, whoever sent it,
  // nor does the lease of a caller. Error(io_error) if nothing can be written there.
  Audit(const std::filesystem::path& folder, std::string secret, AuditLimits limits = {});
  ~Audit();  // writes what waits
  Audit(const Audit&) = delete;
  Audit& operator=(const Audit&) = delete;

  void call(const Call& call);
  void refusal(std::string_view client, std::string_view request, const Refusal& refusal);
  std::uint64_t lost() const;  // lines

 private:
  class File;
  std::string secret_;
  std::unique_ptr<File> calls_, refusals_;
};

}  // namespace ferrobench::server
