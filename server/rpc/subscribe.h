// The methods `subscribe` and `unsubscribe`, for connections that can carry notifications.
#pragma once

#include "server/rpc/dispatcher.h"
#include "server/rpc/hub.h"

namespace ferrobench::server {

// `hub` must outlive `dispatcher`, and have its topics by now.
void add_subscription_methods(Dispatcher& dispatcher, Hub& hub);

}  // namespace ferrobench::server
