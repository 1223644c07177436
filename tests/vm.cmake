# What needs a CAN bus or systemd, which many a machine lacks: run where there is one, tests/vm/run.sh sees to it.
if(NOT ROADVEC_FUZZ AND NOT ROADVEC_SANITIZE)
  add_executable(test_vm_can EXCLUDE_FROM_ALL ${CMAKE_SOURCE_DIR}/tests/vm/socketcan_test.cpp)
  target_link_libraries(test_vm_can PRIVATE drivers_can GTest::gmock GTest::gtest_main)
  add_dependencies(unit_tests test_vm_can)
  add_dependencies(other_tests test_vm_can)
  add_test(NAME vm.can COMMAND ${CMAKE_SOURCE_DIR}/tests/vm/run.sh -c -t 400
    sh -c "${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/test_vm_can && exec python3 -B ${CMAKE_SOURCE_DIR}/tests/vm/can_test.py")
  set_tests_properties(vm.can PROPERTIES LABELS vm TIMEOUT 450 COST 200 FIXTURES_REQUIRED test_drive
    ENVIRONMENT "${test_environment}")
  # The package from installing to purging, in a fresh machine; its root is made once (network), in a minute.
  add_test(NAME vm.package COMMAND python3 -B ${CMAKE_SOURCE_DIR}/tests/vm/package_test.py)
  set_tests_properties(vm.package PROPERTIES LABELS package TIMEOUT 1200 RUN_SERIAL ON ENVIRONMENT "${test_environment}")
endif()
