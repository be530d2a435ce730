// The two ends of a Unix socket, as file descriptors.
#pragma once

#include <string>

namespace ferrobench {

// Listens at `path`, mode 0600. A socket that nobody answers on (a daemon that crashed) is replaced; one that
// somebody answers on is Error(busy), anything else in that place Error(io_error).
int listen_unix(const std::string& path);

// A connected socket, or -1 if nobody listens there.
int connect_unix(const std::string& path);

// Whether the program at the other end belongs to this user or to root. `user`: whose it is.
bool is_trusted_peer(int socket, unsigned* user = nullptr);

}  // namespace ferrobench
