roadvec_test(drivers_velodyne tests/drivers/velodyne LINKS drivers_velodyne)
target_sources(test_drivers_velodyne PRIVATE ${CMAKE_SOURCE_DIR}/tests/support/allocation_count.cpp)
roadvec_test(drivers_can tests/drivers/can LINKS drivers_can)
roadvec_test(drivers_imu tests/drivers/imu LABEL threads LINKS drivers_imu Threads::Threads)

roadvec_fuzz(velodyne_packet LINKS drivers_velodyne)
roadvec_fuzz(pcap LINKS drivers_velodyne)
roadvec_fuzz(calibration LINKS drivers_velodyne)
roadvec_fuzz(streamed_calibration LINKS drivers_velodyne)
roadvec_fuzz(position_packet LINKS drivers_velodyne)
roadvec_fuzz(dbc LINKS drivers_can)
roadvec_fuzz(candump LINKS drivers_can)
roadvec_fuzz(asc LINKS drivers_can)
roadvec_fuzz(mtdata2 LINKS drivers_imu)
roadvec_fuzz(ncom LINKS drivers_imu)
roadvec_fuzz(imu_log LINKS drivers_imu)

roadvec_bench(decode LINKS drivers_velodyne)
# PCL is the opponent: the same packets through its HDLGrabber, in one process. By pkg-config, because find_package(PCL) also
# wants the development files of VTK and MPI, which nothing here uses.
pkg_check_modules(PCL_IO QUIET IMPORTED_TARGET pcl_io)
if(PCL_IO_FOUND)
  roadvec_bench(decode_pcl LINKS drivers_velodyne PkgConfig::PCL_IO)
endif()

# soak_receive: not part of the tests, ten minutes long.
if(NOT ROADVEC_FUZZ)
  add_executable(soak_receive EXCLUDE_FROM_ALL ${CMAKE_SOURCE_DIR}/tests/bench/receive_soak.cpp)
  target_link_libraries(soak_receive PRIVATE drivers_velodyne Threads::Threads)
  add_dependencies(benchmarks soak_receive)
endif()
