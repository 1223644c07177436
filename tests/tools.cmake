roadvec_test(tools_inspect tests/tools/inspect LINKS tools_inspect)
roadvec_test(tools_recording tests/tools/recording LINKS tools_recording)
roadvec_test(tools_simulate tests/tools/simulate LINKS tools_simulate drivers_can drivers_imu nlohmann_json::nlohmann_json)
roadvec_test(tools_score tests/tools/score LINKS tools_score)
roadvec_test(tools_import tests/tools/import LINKS tools_import daemon_config)

roadvec_fuzz(kitti LINKS tools_import)
