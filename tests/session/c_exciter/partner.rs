//! What the plant says, and what others say in its place.

use super::*;

/// Its own heartbeat, and frames of another network under its own identifiers.
#[test]
fn an_own_heartbeat_is_a_double_and_another_network_at_the_base_is_counted() {
    for wire in Wire::ALL {
        let mut bench = playing(wire);
        let network = wire.network();
        let [plant, exciter] = Node::ALL.map(|node| network.node_id(node));
        let other = network.with_node_ids(plant + 10, exciter + 10).unwrap();
        let hello = Transmitter::new(other).frame(&Message::ExciterHello(wire.hello())).unwrap();
        bench.deliver(&hello);
        let id = Id::Standard(MessageKind::ExciterHeartbeat.id(network));
        bench.deliver(&Frame::new(id, FrameFormat::Classic, &[0; 2]).unwrap());
        assert_eq!((bench.both.node.frames().other_sender, bench.outcome()), (2, None));
        let heartbeat = Message::Heartbeat(Heartbeat { node: Node::Exciter, state: NodeState::Operational });
        bench.deliver(&Transmitter::new(network).frame(&heartbeat).unwrap());
        let Some(ExciterOutcome::Faulted(fault)) = bench.outcome() else { panic!("{:?}", bench.outcome()) };
        assert_eq!(fault.code, EmergencyCode::SecondSender);
        bench.both.end();
    }
}

/// In lockstep an exciter gives up for want of samples, and the plant then says why it refused its command.
#[test]
fn the_plant_s_word_after_a_sensor_timeout_is_kept() {
    let plan = Plan { finish: NEVER, give_up: NEVER, beyond: NEVER };
    let mut bench = Bench::new(Wire::Classic, timings()[1], plan, 1);
    (0..100).for_each(|_| bench.tick());
    bench.silence_for(60);
    let Some(ExciterOutcome::Faulted(fault)) = bench.outcome() else { panic!("{:?}", bench.outcome()) };
    assert_eq!(fault.code, EmergencyCode::SensorTimeout);
    let emergency = |code| Message::Emergency(Emergency { node: Node::Plant, code, detail: 1281, sample: 0 });
    let mut plant = Transmitter::new(Wire::Classic.network());
    for code in [EmergencyCode::PartnerFault, EmergencyCode::CommandTimeout] {
        // Whatever counter the plant has come to, the second of two follows the first.
        for _ in 0..2 {
            bench.deliver(&plant.frame(&emergency(code)).unwrap());
        }
    }
    assert_eq!(bench.both.node.plant_fault().map(|said| said.code), Some(EmergencyCode::CommandTimeout));
    bench.both.end();
}
