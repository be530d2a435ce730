// A connection that stays: requests come in, replies and notifications go out, in any mixture. WebSocket and
// Unix socket differ only in how a text is read and written.
//
// One call at a time, and none while its predecessor's reply is unsent: a client that does not read is not
// served. But what stops the bench overtakes what was asked before it. It is carried out again in its turn,
// as what was asked before it may have been a start.
#pragma once

#include <deque>
#include <memory>
#include <string>

#include "server/net/service.h"
#include "server/rpc/subscriber.h"

namespace ferrobench::server {

class Conversation : public Session, public std::enable_shared_from_this<Conversation> {
 public:
  Conversation(Service& service, std::shared_ptr<CallContext> context);
  ~Conversation() override;
  void stop() override;

 protected:
  // To be given by the transport. Each read() ends in one of received(), ended() or broken(), each write() in
  // written() or broken().
  virtual void read() = 0;
  virtual void write(const std::string& text) = 0;
  // Closes; `why` is for the client where the transport can carry it. Reading then ends by itself.
  virtual void hang_up(const std::string& why, bool writing) = 0;

  void begin();
  void received(std::string text);
  void written();
  void ended();   // no more requests, but replies still get through
  void broken();  // nothing gets through any more
  // A last text, then the end.
  void farewell(std::string text);

 private:
  struct Waiting {
    std::string text{};
    bool again = false;   // it has overtaken
    bool silent = false;  // and was answered then
  };
  void pump();
  void overtake(const Waiting& stop);
  void finish(const std::string& why);

  std::shared_ptr<CallContext> context_;
  std::deque<Waiting> inbox_;
  std::size_t inbox_bytes_ = 0;
  std::deque<Subscriber::Text> replies_;
  Subscriber::Text sending_;
  bool reading_ = false;
  bool calling_ = false;
  int overtaking_ = 0;  // stops under way ahead of their turn
  bool last_ = false;   // takes no further requests
  bool finished_ = false;
};

}  // namespace ferrobench::server
