#!/usr/bin/env python3
"""Writes made-up seeds for the fuzz targets, shaped as real sensors, files and clients shape their bytes.

    make_seeds.py CORPUS_DIR      one folder for each target: CORPUS_DIR/fuzz_dbc/...
"""
import pathlib
import struct
import sys


def blocks(flags, azimuth_step_cdeg, status, device_us=1000):
    """A Velodyne data packet: 12 blocks of 32 echoes, then time and two bytes of status."""
    packet = b""
    for block, flag in enumerate(flags):
        echoes = b"".join(struct.pack("<HB", 1000 + 37 * lane + block, 40 + lane) for lane in range(32))
        packet += struct.pack("<HH", flag, block * azimuth_step_cdeg % 36000) + echoes
    return packet + struct.pack("<I", device_us) + bytes(status)


VLP16 = blocks([0xEEFF] * 12, 40, (0x37, 0x22))
DUAL = blocks([0xEEFF] * 12, 0, (0x39, 0x28))
HDL64 = blocks([0xEEFF, 0xDDFF] * 6, 9, (0x48, 0x0C))
VLS128 = blocks([0xEEFF, 0xDDFF, 0xCCFF, 0xBBFF] * 3, 10, (0x37, 0xA1))


def nmea(body):
    total = 0
    for letter in body.encode():
        total ^= letter
    return f"${body}*{total:02X}\r\n".encode()


RMC = nmea("GPRMC,130211,A,4900.6733,N,00825.3727,E,010.2,251.4,221126,001.2,E")
POSITION = bytes(198) + struct.pack("<I", 1_234_567) + b"\x02\0\0\0" + RMC
POSITION += bytes(512 - len(POSITION))


def udp_frame(payload):
    udp = struct.pack(">HHHH", 2368, 2368, 8 + len(payload), 0) + payload
    ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 1, 0, 64, 17, 0, b"\xc0\xa8\x01\xc9", b"\xff\xff\xff\xff")
    return bytes(12) + b"\x08\x00" + ip + udp


def pcap(frames):
    text = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    for number, frame in enumerate(frames):
        text += struct.pack("<IIII", 1_700_000_000, number * 1327, len(frame), len(frame)) + frame
    return text


def xsens(data):
    message = bytes((0xFF, 0x36, len(data))) + data
    return b"\xfa" + message + bytes((-sum(message) & 0xFF,))


MTDATA2 = xsens(struct.pack(">HBH", 0x1020, 2, 7) + struct.pack(">HBI", 0x1060, 4, 12345) +
                struct.pack(">HB3f", 0x8020, 12, 0.01, -0.02, 0.3) + struct.pack(">HB3f", 0x4020, 12, 0.1, 0.2, 9.8) +
                struct.pack(">HB4f", 0x2010, 16, 1, 0, 0, 0))


def ncom():
    packet = bytearray(72)
    packet[0] = 0xE7
    struct.pack_into("<H", packet, 1, 12345)
    packet[21] = 4
    struct.pack_into("<dd", packet, 23, 0.855, 0.147)
    packet[22], packet[61] = sum(packet[1:22]) & 0xFF, sum(packet[1:61]) & 0xFF
    packet[71] = sum(packet[1:71]) & 0xFF
    return bytes(packet)


DBC = b"""VERSION "1"
BU_: EPS ABS
BO_ 194 Steering: 8 EPS
 SG_ Angle : 7|16@0- (0.1,0) [-800|800] "deg" ABS
 SG_ Mode M : 24|4@1+ (1,0) [0|15] "" ABS
 SG_ Low m0 : 32|12@1+ (0.01,-67.67) [0|1] "km/h" ABS
BO_ 2566834176 Wheels: 64 ABS
 SG_ Front : 0|32@1- (1,0) [0|1] "m/s" EPS
CM_ SG_ 194 Angle "Left
positive.";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_ "GenMsgCycleTime" BO_ 194 10;
VAL_ 194 Mode 0 "off" 1 "on" ;
SIG_VALTYPE_ 2566834176 Front : 1;
SG_MUL_VAL_ 194 Low Mode 0-3, 5-5;
"""
CANDUMP = (b"(1436509052.249713) can0 123#1122334455667788", b"(1.000001) vcan0 12345678##1AABBCC R",
           b" can0  123   [8]  11 22 33 44 55 66 77 88", b"(1.5) can0 20000040#0000000000000000",
           b"DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)")
ASC = (b"date Thu Jan 01 12:00:00.000 pm 2026\nbase hex timestamps absolute\n0.001000 1  123  Rx   d 8 11 22 33 44 55 66 77 88\n"
       b"0.002 1 12345678x Tx r\n0.003 CANFD 1 Rx 123 1 0 d 16 " + b"00 " * 16 + b"\n0.004 1 ErrorFrame\n")
DB_XML = b"""<?xml version="1.0"?><boost_serialization><DB><distLSB_>0.2</distLSB_><enabled_><item>1</item></enabled_>
<minIntensity_><item>0</item></minIntensity_><maxIntensity_><item>255</item></maxIntensity_><points_><item><px><id_>0</id_>
<rotCorrection_>-4.5</rotCorrection_><vertCorrection_>-7.1</vertCorrection_><distCorrection_>110</distCorrection_>
<vertOffsetCorrection_>20</vertOffsetCorrection_><horizOffsetCorrection_>2.6</horizOffsetCorrection_></px></item></points_></DB></boost_serialization>"""
ROS_YAML = b"""lasers:
- {dist_correction: 1.1, dist_correction_x: 1.2, dist_correction_y: 1.2, focal_distance: 10.5, focal_slope: 2.0,
  horiz_offset_correction: 0.025, laser_id: 0, min_intensity: 40, rot_correction: -0.07, vert_correction: -0.12,
  vert_offset_correction: 0.2}
num_lasers: 1
distance_resolution: 0.002
"""
CONFIG = b"""[lidar]
model = "VLP-16"
x_m = 1.0
y_m = 0.0
z_m = 1.7
roll_deg = 0.0
pitch_deg = 0.0
yaw_deg = 0.0
[imu]
protocol = "ncom"
[anchor]
latitude_deg = 49.0
longitude_deg = 8.4
height_m = 112.0
yaw_deg = 10.0
"""
HELLO = b"\x0a\x08\x08\x01\x10\x00\x1a\x02me"  # Envelope.hello: version 1, any minor, a name
GET_TILES, SUBSCRIBE = b"\x1a\x00", b"\x2a\x00"

KITTI_ROW = b"49.01 8.42 112.8 0.02 1e-05 -1.22 " + b"0.5 " * 24
KITTI_SCAN = b"".join(struct.pack("<4f", *p) for p in ((9, 1, -1, 0.3), (-9, 1, -1, 0.3), (9, -1, -1, 0.3), (8, 1, -1, 0.3), (0, 0, 0, 0)))

SEEDS = {
    "fuzz_velodyne_packet": [bytes((model, 10)) + packet * 3 for model in range(7) for packet in (VLP16, DUAL, HDL64, VLS128)],
    "fuzz_pcap": [pcap([udp_frame(VLP16)] * 3), pcap([udp_frame(POSITION)]), udp_frame(VLP16)],
    "fuzz_calibration": [DB_XML, ROS_YAML],
    "fuzz_streamed_calibration": [bytes((1, 0)) + bytes((200, 0, 1)) * 40, bytes((0, 3)) + bytes((255, 2, 9)) * 20],
    "fuzz_position_packet": [POSITION, RMC[1:-5], b"GPGGA,130211,4900.6733,N,00825.3727,E,1,08,0.9,112.0,M,47.9,M,,"],
    "fuzz_dbc": [DBC],
    "fuzz_candump": list(CANDUMP),
    "fuzz_asc": [ASC],
    "fuzz_mtdata2": [bytes((20,)) + MTDATA2 * 2, bytes((20,)) + MTDATA2[:-1] + b"\0" + MTDATA2],
    "fuzz_ncom": [b"\x48" + ncom() * 2],
    "fuzz_imu_log": [b"(1700000000.123456) " + MTDATA2.hex().encode()],
    "fuzz_kitti": [b"\0" + b"2011-09-26 13:04:32.349659964", b"\1" + KITTI_ROW, b"\3" + KITTI_SCAN,
                   b"\2calib_time: x\nR: 1 0 0 0 1 0 0 0 1\nT: -0.8 0.3 -0.8\n"],
    "fuzz_wire": [HELLO, GET_TILES, SUBSCRIBE],
    "fuzz_server_frame": [b"\x10" + b"".join(struct.pack("<I", len(m)) + m for m in (HELLO, GET_TILES, SUBSCRIBE))],
    "fuzz_geometry": [b"GP\0\3" + struct.pack("<i4dBII6d", 4326, 8.4, 8.5, 49.0, 49.1, 1, 1002, 2, 8.4, 49.0, 112.0, 8.5, 49.1, 113.0)],
    "fuzz_packed_lines": [struct.pack("<I4B2fI", 2, 1, 0, 1, 0, 0.1, 0.9, 7) + struct.pack("<4h2B", 500, -20, 0, 100, 10, 20) * 2] * 2,
    "fuzz_config": [CONFIG],
}


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    for target, seeds in SEEDS.items():
        folder = pathlib.Path(sys.argv[1]) / target
        folder.mkdir(parents=True, exist_ok=True)
        for number, seed in enumerate(seeds):
            (folder / f"seed_{number}").write_bytes(seed)


if __name__ == "__main__":
    main()
