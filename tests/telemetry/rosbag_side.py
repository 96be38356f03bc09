"""What ROS 1 itself does with bags; run by the system's Python, which has rosbag, never imported.

rosbag_side.py read BAG             prints what it read, as JSON
rosbag_side.py foreign BAG COMPRESSION    writes a robot's bag, with transforms, moving to the east
"""

import hashlib
import json
import sys


def read(path):
    """Decode every message by the definition in the bag and count, per topic."""
    import genpy.dynamic
    import rosbag

    with rosbag.Bag(path) as bag:
        topics, sums = {}, {}
        for connection in bag._get_connections():
            made = genpy.dynamic.generate_dynamic(connection.datatype, connection.msg_def)
            sums[connection.topic] = made[connection.datatype]._md5sum == connection.md5sum
        newest, ordered = 0, True
        for topic, message, stamp in bag.read_messages():
            said = topics.setdefault(topic, {"count": 0, "type": message._type, "fixes": []})
            said["count"] += 1
            ordered = ordered and stamp.to_nsec() >= newest
            newest = stamp.to_nsec()
            if message._type == "sensor_msgs/NavSatFix":
                at_ns = message.header.stamp.to_nsec()
                said["fixes"].append([at_ns, message.latitude, message.longitude])
        for said in topics.values():
            said["fixes"] = hashlib.sha256(json.dumps(said["fixes"]).encode()).hexdigest()
    return {"topics": topics, "sums": sums, "ordered": ordered}


def foreign(path, compression):
    """Write a bag as a robot's recorder does: 20 s at 10 m/s, chunk by chunk compressed."""
    import rosbag
    import rospy
    from geometry_msgs.msg import TransformStamped
    from sensor_msgs.msg import Imu, NavSatFix
    from tf2_msgs.msg import TFMessage

    def transform(child, x, z, stamp):
        one = TransformStamped()
        one.header.stamp, one.header.frame_id, one.child_frame_id = stamp, "base_link", child
        one.transform.translation.x, one.transform.translation.z = x, z
        one.transform.rotation.w = 1.0
        return TFMessage(transforms=[one])

    with rosbag.Bag(path, "w", compression=compression, chunk_threshold=4096) as bag:
        start = rospy.Time(1772366400)
        bag.write("/tf_static", transform("gps", 1.5, 1.6, start), start)
        for tick in range(200):
            stamp = start + rospy.Duration.from_sec(0.1 * tick)
            fix = NavSatFix(latitude=52.5, longitude=13.4 + 1.4754e-5 * tick, altitude=40.0)
            fix.header.stamp, fix.header.frame_id = stamp, "gps"
            imu = Imu()
            imu.header.stamp, imu.header.frame_id = stamp, "base_link"
            imu.linear_acceleration.z = 9.8
            bag.write("/gps/fix", fix, stamp)
            bag.write("/imu/data", imu, stamp)
            bag.write("/tf", transform("wheel", 0.0, 0.3, stamp), stamp)
    return {}


if __name__ == "__main__":
    print(json.dumps({"read": read, "foreign": foreign}[sys.argv[1]](*sys.argv[2:])))
