#include "server/rpc/subscribe.h"

#include <optional>
#include <string>

namespace ferrobench::server {
namespace {

struct SubscribeParams {
  std::string topic;
  std::optional<double> max_rate;  // Hz
};
template <class Visitor>
void describe(Visitor& visit, SubscribeParams& p) {
  visit("topic", p.topic, {.required = true, .doc = "what to be told of; rpc.discover lists the topics"});
  visit("max_rate_Hz", p.max_rate,
        {.unit = "Hz", .min = 0.01, .max = 1000, .doc = "merge messages to at most so many a second"});
}

struct UnsubscribeParams {
  std::string topic;
};
template <class Visitor>
void describe(Visitor& visit, UnsubscribeParams& p) {
  visit("topic", p.topic, {.required = true, .doc = "what not to be told of any more"});
}

struct Subscribed {
  std::string topic;
  bool subscribed = false;
};
template <class Visitor>
void describe(Visitor& visit, Subscribed& s) {
  visit("topic", s.topic, {.required = true});
  visit("subscribed", s.subscribed, {.required = true, .doc = "whether notifications come from now on"});
}

Subscriber& outbox(const CallContext& context) {
  if (!context.subscriber)
    throw Error(ErrorCode::bad_state, "this connection cannot carry notifications",
                Problem{.path = "",
                        .message = "HTTP POST has no way back",
                        .hint = "open a WebSocket at /rpc, or the Unix socket, and subscribe there"});
  return *context.subscriber;
}

}  // namespace

void add_subscription_methods(Dispatcher& dispatcher, Hub& hub) {
  dispatcher.add<SubscribeParams>({.name = "subscribe",
                                   .doc = "Sends notifications of a topic on this connection from now on.",
                                   .errors = {ErrorCode::not_found, ErrorCode::bad_state}},
                                  [&hub](const SubscribeParams& p, CallContext& context) {
                                    outbox(context);
                                    hub.subscribe(p.topic, context.subscriber, p.max_rate);
                                    return Subscribed{p.topic, true};
                                  });
  dispatcher.add<UnsubscribeParams>({.name = "unsubscribe",
                                     .doc = "Ends the notifications of a topic on this connection.",
                                     .errors = {ErrorCode::not_found, ErrorCode::bad_state}},
                                    [&hub](const UnsubscribeParams& p, CallContext& context) {
                                      hub.unsubscribe(p.topic, outbox(context));
                                      return Subscribed{p.topic, false};
                                    });
}

}  // namespace ferrobench::server
