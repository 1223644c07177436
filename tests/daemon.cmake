roadvec_test(daemon_server tests/daemon/server LABEL threads LINKS daemon_server)
if(TARGET test_daemon_server)
  add_dependencies(test_daemon_server roadvec)  # runs it
endif()
roadvec_test(daemon_store tests/daemon/store LABEL threads LINKS daemon_store)
roadvec_test(daemon_config tests/daemon/config LINKS daemon_config)
roadvec_test(daemon_replay tests/daemon/replay LINKS daemon_config)
if(TARGET test_daemon_replay)
  add_dependencies(test_daemon_replay roadvec-replay)
endif()
roadvec_test(daemon_vehicles tests/daemon/vehicles LINKS daemon)
roadvec_test(daemon_health tests/daemon/health LINKS daemon)

roadvec_fuzz(server_frame LINKS daemon_server)
roadvec_fuzz(geometry LINKS daemon_store)
roadvec_fuzz(config LINKS daemon_config)

roadvec_test(daemon_stages tests/daemon/stages LABEL threads LINKS daemon_stages)
# It stands in for the allocator; in a unit of others the compiler takes it for a mismatch.
set_source_files_properties(${CMAKE_SOURCE_DIR}/tests/support/allocation_count.cpp PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
target_sources(test_daemon_stages PRIVATE ${CMAKE_SOURCE_DIR}/tests/support/allocation_count.cpp)

# soak_clients: what clients of the map socket wait for, and cost. Not part of the tests.
if(NOT ROADVEC_FUZZ)
  add_executable(soak_clients EXCLUDE_FROM_ALL ${CMAKE_SOURCE_DIR}/tests/bench/clients_soak.cpp)
  target_link_libraries(soak_clients PRIVATE daemon_server)
  add_dependencies(benchmarks soak_clients)
endif()
