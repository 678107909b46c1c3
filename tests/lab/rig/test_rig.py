"""Arms in bags and hand-eye files: what goes in comes out, and what is missing is named."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from rosbags.rosbag1 import Writer
from strategies import line, unreadable

from lmmap.cli import main
from lmmap_lab.bench import rosbag_writer
from lmmap_lab.rig import standin, tf, ur5e
from lmmap_lab.rig.hand_eye_file import read_hand_eye
from lmmap_lab.rig.truth import true_trajectory

T_US = (np.arange(40) * 8000 + 10**6).astype(np.int64)
JOINTS = np.array([0.3, -1.5, 1.2, -0.4, 1.4, 3.0]) + 0.2 * np.sin(T_US[:, None] * 1e-6 * np.arange(1, 7))


def write_arm(path, without=(), joints=JOINTS):
    """A bag with nothing but an arm's /tf and /joint_states, less the topics or links in ``without``."""
    topics = {topic: (kind, list(messages)) for topic, kind, messages in tf.arm_messages(T_US, joints)}
    with Writer(path) as bag:
        for topic, (kind, messages) in topics.items():
            connection = bag.add_connection(topic, kind, typestore=rosbag_writer.STORE)
            for t_us, raw in messages if topic not in without else ():
                bag.write(connection, int(t_us) * 1000, _less(raw, without) if topic == "/tf" else raw)
    return path


def _less(raw, children):
    return _edited(raw, lambda links: [t for t in links if t.child_frame_id not in children])


def _edited(raw, edit):
    message = rosbag_writer.STORE.deserialize_ros1(raw, tf.TF[0])
    message.transforms = edit(message.transforms)
    return bytes(rosbag_writer.STORE.serialize_ros1(message, tf.TF[0]))


def assert_moves_as(motion: ur5e.ArmMotion, joints=JOINTS):
    wanted = ur5e.forward(joints)
    assert np.array_equal(motion.t_us, T_US)
    np.testing.assert_allclose(motion.T_root_tip.position_m, wanted.position_m, atol=1e-12)
    np.testing.assert_allclose(motion.T_root_tip.rotation, wanted.rotation, atol=1e-12)


def test_the_chain_of_tf_is_forward_kinematics_and_back(tmp_path):
    path = write_arm(tmp_path / "a.bag")
    there = tf.arm_motion(path, "base_link", "tool0")
    assert_moves_as(there)
    back = tf.arm_motion(path, "tool0", "base_link")
    np.testing.assert_allclose((there.T_root_tip @ back.T_root_tip).position_m, 0, atol=1e-12)
    assert tf.arm_ends(path) == ("base_link", "tool0")


@pytest.mark.parametrize("lacks", [("forearm_link",), ("flange", "tool0", "base_link_inertia"), ("/tf",)])
def test_joint_states_stand_in_for_links_that_tf_lacks(tmp_path, lacks):
    path = write_arm(tmp_path / "a.bag", without=lacks)
    moves = [link for link in lacks if link not in ("flange", "tool0", "base_link_inertia")]
    if moves:
        with pytest.warns(UserWarning, match="taking /joint_states"):
            assert_moves_as(tf.arm_motion(path, "base_link", "tool0"))
    else:
        assert_moves_as(tf.arm_motion(path, "base_link", "tool0"))


def test_a_missing_arm_is_named(tmp_path):
    path = write_arm(tmp_path / "a.bag", without=("forearm_link", "/joint_states"))
    assert re.search("a.bag: /tf has no link upper_arm_link to forearm_link",
                     line(tf.arm_motion, path, "base_link", "tool0"))  # fmt: skip
    assert "no frames world and hand in /tf; it has base" in line(tf.arm_motion, path, "world", "hand")
    with Writer(tmp_path / "b.bag") as bag:
        bag.add_connection("/rosout", "std_msgs/msg/String", typestore=rosbag_writer.STORE)
    assert "no /tf and no /joint_states among its topics (/rosout)" in line(
        tf.read_transforms, tmp_path / "b.bag"
    )
    whole = write_arm(tmp_path / "c.bag").read_bytes()
    (tmp_path / "c.bag").write_bytes(whole[: len(whole) // 2])
    assert "c.bag: cannot read this bag" in line(tf.read_transforms, tmp_path / "c.bag")


def test_an_arm_that_is_no_chain_of_poses_is_named(tmp_path, monkeypatch):
    def nowhere(links):
        links[3].transform.translation.x = np.nan
        return links

    def far(links):
        links[3].transform.translation.x = 1e300
        return links

    def turned_by_nothing(links):
        links[3].transform.rotation = replace(links[3].transform.rotation, x=0.0, y=0.0, z=0.0, w=0.0)
        return links

    def looped(links):
        back = replace(links[5], header=replace(links[5].header, frame_id="base_link"))
        return [*links, back]

    for edit, said in ((nowhere, "forearm_link to wrist_1_link is not finite"),
                       (far, "forearm_link to wrist_1_link has a position beyond"),
                       (turned_by_nothing, "forearm_link to wrist_1_link has a quaternion"),
                       (looped, "with base_link to wrist_3_link and without")):  # fmt: skip
        monkeypatch.setitem(globals(), "_less", lambda raw, _, edit=edit: _edited(raw, edit))
        path = write_arm(tmp_path / f"{edit.__name__}.bag")
        assert said in line(tf.arm_motion, path, "base_link", "tool0")


def test_an_error_is_one_line_whatever_names_it_repeats(tmp_path, capsys):
    path = write_arm(tmp_path / "a.bag")
    code = main.main(["calibrate", str(path), "--base", "a\nb", "--effector", "c" * 5000])
    err = capsys.readouterr().err
    assert code == 1 and err.startswith("lmmap: ") and "a b" in err
    assert len(err.splitlines()) == 1 and len(err) < 2100


def test_a_rig_and_its_arm_give_the_truth(tmp_path):
    path = write_arm(tmp_path / "a.bag")
    rig = replace(standin.RIG, delay_s=0.016)
    truth = true_trajectory(path, rig)
    wanted = rig.T_cam_root @ ur5e.forward(JOINTS) @ rig.T_tip_port
    np.testing.assert_allclose(truth.poses.position_m, wanted.position_m, atol=1e-12)
    assert np.array_equal(truth.t_us, T_US - 16_000)  # the arm's clock is ahead


def test_what_is_no_file_or_too_large_is_not_read(tmp_path):
    for path, words in unreadable(tmp_path):
        assert words in line(read_hand_eye, path)


def test_a_hand_eye_file_that_states_a_value_twice(tmp_path):
    standin.write_hand_eye(tmp_path / "h.yaml")
    text = (tmp_path / "h.yaml").read_text()
    (tmp_path / "h.yaml").write_text(text + "transformation: {x: 0}\n")
    assert "transformation is stated twice" in line(read_hand_eye, tmp_path / "h.yaml")


def test_hand_eye_files_of_every_layout_agree(tmp_path):
    standin.write_hand_eye(tmp_path / "a.yaml")
    hand_eye = read_hand_eye(tmp_path / "a.yaml")
    wanted = standin.RIG.T_cam_root.inverse
    assert hand_eye.ends == ("base_link", "tool0")
    document = yaml.safe_load((tmp_path / "a.yaml").read_text())
    flat = {**document["parameters"], "transformation": document["transformation"]}  # as older versions wrote
    matrix = np.vstack([np.column_stack([wanted.rotation, wanted.position_m]), [0, 0, 0, 1]]).tolist()
    opencv = "%YAML:1.0\n---\nT: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: d\n  data: "
    texts = [yaml.safe_dump(flat), yaml.safe_dump(matrix), yaml.safe_dump({"T": {"m": matrix}}),
             opencv + str(np.ravel(matrix).tolist())]  # fmt: skip
    for text in texts:
        (tmp_path / "b.yaml").write_text(text)
        other = read_hand_eye(tmp_path / "b.yaml")
        np.testing.assert_allclose(other.T_frame_cam.rotation, wanted.rotation, atol=1e-12)
        np.testing.assert_allclose(other.T_frame_cam.position_m, wanted.position_m, atol=1e-12)
    document["parameters"] |= {"eye_on_hand": True, "robot_effector_frame": "/hand"}
    (tmp_path / "b.yaml").write_text(yaml.safe_dump(document))
    assert read_hand_eye(tmp_path / "b.yaml").ends == ("hand", "base_link")


@pytest.mark.parametrize("text, said", [
    ("transformation: {x: 1}", "lacks qx, qy, qz, qw"),
    ("transformation: {x: 0, y: 0, z: 0, qx: 1, qy: 1, qz: 0, qw: 1}", "not of unit length"),
    ("camera: [1, 2]\nnotes: none", "keys camera, notes"),
    ("[[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", "no rigid transform"),
    ("a: [b", "not YAML"),
    ("&a {b: *a}", "refers to its own parts"),
    ("[" * 600, "not YAML"),
    ("[[.nan,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", "4 x 4 finite numbers"),
    ("transformation: {x: .nan, y: 0, z: 0, qx: 0, qy: 0, qz: 0, qw: 1}\nparameters: [1]", "not finite"),
    ("[[1,0,0,1.0e+300],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", "finite numbers up to"),
    (f"[[1,0,0,{'9' * 400}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", "too large"),
    ("a: 1\n" * 50_000, "letters, and at most"),
    ("", "NoneType"),
])  # fmt: skip
def test_a_file_that_is_no_hand_eye_shows_what_was_found(tmp_path, text, said):
    (tmp_path / "h.yaml").write_text(text)
    message = line(read_hand_eye, tmp_path / "h.yaml")
    assert said in message and message.startswith(f"{tmp_path / 'h.yaml'}: ")


def test_what_a_killed_run_left_beside_a_hand_eye_file_is_removed(tmp_path):
    path, left = tmp_path / "eye.yaml", tmp_path / ".eye.yaml.writing"
    standin.write_hand_eye(path)
    left.touch()
    standin.write_hand_eye(path)
    assert sorted(tmp_path.iterdir()) == [path]
