# The programs as a user meets them: started, fed, asked and stopped from outside. On one short drive, simulated anew.
if(NOT ROADVEC_FUZZ)
  set(test_drive ${CMAKE_BINARY_DIR}/tests/street)
  set(test_modules ${CMAKE_SOURCE_DIR}/tests/programs:${CMAKE_SOURCE_DIR}/tests/support/python)
  set(test_environment "ROADVEC_BIN=${CMAKE_RUNTIME_OUTPUT_DIRECTORY};ROADVEC_SOURCE=${CMAKE_SOURCE_DIR};ROADVEC_RECORDINGS=${ROADVEC_RECORDINGS};ROADVEC_TEST_DRIVE=${test_drive};PYTHONPATH=${test_modules}")
  function(roadvec_programs_test name)
    add_test(NAME programs.${name} COMMAND /usr/bin/python3 -B ${CMAKE_SOURCE_DIR}/tests/programs/${name}.py)
    # Alone: drives are played at their true rate, and loads are made on purpose.
    set_tests_properties(programs.${name} PROPERTIES LABELS drive TIMEOUT 600 RUN_SERIAL ON ${ARGN}
      ENVIRONMENT "${test_environment}")
  endfunction()
  roadvec_programs_test(make_drive FIXTURES_SETUP test_drive)
  foreach(name drive_test errors_test gps_test import_test imu_test inspect_test live_test kitti_test man_test scenes_test service_test streamed_test tables_test)
    roadvec_programs_test(${name} FIXTURES_REQUIRED test_drive)
  endforeach()
endif()
