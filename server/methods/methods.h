// Every method of the bench, area by area. Each file of this folder holds one area: the structs of its
// parameters and results, and the rows that it adds to the table.
//
// | area      | methods                                                          |
// | system    | info                                                             |
// | device    | list open close info selftest                                    |
// | limits    | get set                                                          |
// | protocol  | list get put schema validate preview                             |
// | run       | start status pause resume abort list                             |
// | queue     | add list move remove start stop confirm summary                  |
// | replay    | start                                                            |
// | recording | list info read report compare export import annotate recover delete |
// | model     | list get put schema simulate fit effects                         |
// | discrepancy | start status result                                            |
// | table     | run compare                                                      |
// | job       | list status cancel                                               |
// | lease     | acquire renew release status                                     |
// |           | subscribe unsubscribe rpc.discover                               |
#pragma once

#include <memory>

#include "server/engine/engine.h"
#include "server/rpc/dispatcher.h"

namespace ferrobench::server {

class Queue;

// The table of all methods, with the lease as its gate. Engine and dispatcher must outlive the calls.
void add_all_methods(Dispatcher& rpc, Engine& engine, const std::shared_ptr<Queue>& queue);
// With a queue of their own, which takes items and runs none.
void add_all_methods(Dispatcher& rpc, Engine& engine);
// Calls of every method as rpc.discover shows them: {method: parameters by name}. A test holds them against
// the schemas.
nlohmann::json method_examples();

void add_system_methods(Dispatcher& rpc, Engine& engine);  // system, limits, job, lease
void add_device_methods(Dispatcher& rpc, Engine& engine);
void add_protocol_methods(Dispatcher& rpc, Engine& engine);
void add_run_methods(Dispatcher& rpc, Engine& engine, const std::shared_ptr<Queue>& queue);
void add_queue_methods(Dispatcher& rpc, const std::shared_ptr<Queue>& queue);
void add_recording_methods(Dispatcher& rpc, Engine& engine);
void add_import_method(Dispatcher& rpc, Engine& engine);
void add_model_methods(Dispatcher& rpc, Engine& engine);
void add_effect_methods(Dispatcher& rpc);
void add_discrepancy_methods(Dispatcher& rpc, Engine& engine);
void add_table_methods(Dispatcher& rpc, Engine& engine);

}  // namespace ferrobench::server
